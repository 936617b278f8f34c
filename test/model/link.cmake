# SPDX-License-Identifier: Apache-2.0
find_package(sdformat12 QUIET)
if(sdformat12_FOUND)
  target_link_libraries(test_model PRIVATE sdformat12::sdformat12)
  target_compile_definitions(test_model PRIVATE DYNID_HAVE_SDFORMAT)
else()
  message(STATUS "dynid: libsdformat was not found: reading SDF back is left out of the tests")
endif()
