# SPDX-License-Identifier: Apache-2.0
#
# The installed package as a user has it. Run by ctest, step after step, with
#   cmake -D STEP=install -D BUILD=... -D SOURCE=... -D WORK=... -D GENERATOR=... -D COMPILER=... -D FLAGS=... -D SHARED=...
#     -P this                        installs the build into a prefix, moves the prefix, and runs the program there
#   ... STEP=consumer, headers_<i>   builds that part of test/packaging/consumer against it, i below -D HEADER_PARTS=...
#   ... STEP=<example>               builds one of the examples against it, and runs it
cmake_minimum_required(VERSION 3.16)

function(run)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    list(JOIN ARGV " " command)
    message(FATAL_ERROR "'${command}' ended with ${status}:\n${output}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

# The step's target of the project in a folder, against the prefix.
function(build folder)
  run("${CMAKE_COMMAND}" -S "${SOURCE}/${folder}" -B "${WORK}/${STEP}" -G "${GENERATOR}" "-DDYNID_SHARED=${SHARED}"
    "-DCMAKE_CXX_COMPILER=${COMPILER}" "-DCMAKE_CXX_FLAGS=${FLAGS}" "-DCMAKE_PREFIX_PATH=${WORK}/prefix"
    "-DHEADER_PARTS=${HEADER_PARTS}" --no-warn-unused-cli -DCMAKE_FIND_USE_PACKAGE_REGISTRY=OFF)
  run("${CMAKE_COMMAND}" --build "${WORK}/${STEP}" --target "${STEP}")
endfunction()

set(program "${WORK}/prefix/bin/dynid")
set(model "${WORK}/prefix/share/dynid/config/panda.yaml")
if(STEP STREQUAL "install")
  file(REMOVE_RECURSE "${WORK}")
  file(MAKE_DIRECTORY "${WORK}")
  run("${CMAKE_COMMAND}" --install "${BUILD}" --prefix "${WORK}/installed")
  file(RENAME "${WORK}/installed" "${WORK}/prefix")
  run("${program}" --help)
  run("${program}" export --model "${model}" --format urdf --out "${WORK}/panda.urdf")
elseif(STEP MATCHES "^(consumer|headers_[0-9])$")
  build(test/packaging/consumer)
else()
  build(examples)
  if(STEP MATCHES "urdf")
    set(model "${WORK}/panda.urdf")
  endif()
  run("${WORK}/${STEP}/${STEP}" "${model}")  # those that need none pass over it
  message("${output}")
endif()
