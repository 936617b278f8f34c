# SPDX-License-Identifier: Apache-2.0
# The program's JSON is compared with the library's; reports are read as XML.
add_dependencies(test_app dynid_program)
target_link_libraries(test_app PRIVATE EXPAT::EXPAT)
