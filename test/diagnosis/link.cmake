# SPDX-License-Identifier: Apache-2.0
# The number of threads is set.
target_link_libraries(test_diagnosis PRIVATE TBB::tbb)
