#SPDX - License - Identifier : Apache - 2.0
#The program 's JSON is compared with the library' s.
add_dependencies(test_app dynid_program)
