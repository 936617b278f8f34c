# SPDX-License-Identifier: Apache-2.0
#
# Installs the build into a prefix, moves the prefix, and builds against it what a user would: the examples, which are
# then run, and test/packaging/consumer. Run by ctest with
#   cmake -D BUILD=... -D SOURCE=... -D WORK=... -D GENERATOR=... -D COMPILER=...
#     -D FLAGS=... -D SHARED=... -P this
cmake_minimum_required(VERSION 3.16)

function(run)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    list(JOIN ARGV " " command)
    message(FATAL_ERROR "'${command}' ended with ${status}:\n${output}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

file(REMOVE_RECURSE "${WORK}")
file(MAKE_DIRECTORY "${WORK}")
run("${CMAKE_COMMAND}" --install "${BUILD}" --prefix "${WORK}/installed")
file(RENAME "${WORK}/installed" "${WORK}/prefix")

foreach(project examples test/packaging/consumer)
  get_filename_component(name "${project}" NAME)
  run("${CMAKE_COMMAND}" -S "${SOURCE}/${project}" -B "${WORK}/${name}" -G "${GENERATOR}"
    "-DDYNID_SHARED=${SHARED}" "-DCMAKE_CXX_COMPILER=${COMPILER}" "-DCMAKE_CXX_FLAGS=${FLAGS}"
    "-DCMAKE_PREFIX_PATH=${WORK}/prefix" --no-warn-unused-cli -DCMAKE_FIND_USE_PACKAGE_REGISTRY=OFF)
  run("${CMAKE_COMMAND}" --build "${WORK}/${name}" --parallel 2)
endforeach()

file(GLOB examples "${SOURCE}/examples/*.cpp")
if(NOT examples)
  message(FATAL_ERROR "there is no example in ${SOURCE}/examples")
endif()
set(model "${WORK}/prefix/share/dynid/config/panda.yaml")
run("${WORK}/prefix/bin/dynid" export --model "${model}" --format urdf --out "${WORK}/panda.urdf")
foreach(example IN LISTS examples)
  get_filename_component(name "${example}" NAME_WE)
  if(name MATCHES "urdf")
    run("${WORK}/examples/${name}" "${WORK}/panda.urdf")
  else()
    run("${WORK}/examples/${name}" "${model}")  # those that need none pass over it
  endif()
  message("${name}:\n${output}")
endforeach()

run("${WORK}/prefix/bin/dynid" --help)
