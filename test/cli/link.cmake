# SPDX-License-Identifier: Apache-2.0
# The Panda as a C++ header, as `dynid export` writes it.
set(_header "${CMAKE_CURRENT_BINARY_DIR}/generated/panda_model.hpp")
file(MAKE_DIRECTORY "${CMAKE_CURRENT_BINARY_DIR}/generated")
add_custom_command(OUTPUT "${_header}"
  COMMAND dynid_program export --quiet --model "${PROJECT_SOURCE_DIR}/config/panda.yaml" --format header --out "${_header}"
  DEPENDS dynid_program "${PROJECT_SOURCE_DIR}/config/panda.yaml")
target_sources(test_cli PRIVATE "${_header}")
target_include_directories(test_cli PRIVATE "${CMAKE_CURRENT_BINARY_DIR}/generated")
if(DYNID_WITH_MPI)  # one answer from one process and from four
  find_package(MPI REQUIRED COMPONENTS CXX)
  target_compile_definitions(test_cli PRIVATE DYNID_MPIEXEC="${MPIEXEC_EXECUTABLE}")
endif()
target_link_libraries(test_cli PRIVATE dynid_commands)  # a subcommand out of tree
target_include_directories(test_cli PRIVATE "${PROJECT_SOURCE_DIR}/nodes")
