# SPDX-License-Identifier: Apache-2.0
# The fit is compared with the letter's own search.
target_link_libraries(test_friction PRIVATE NLopt::nlopt)
