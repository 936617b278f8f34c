# SPDX-License-Identifier: Apache-2.0
# Reports are read as XML; the number of threads is set.
target_link_libraries(test_diagnosis PRIVATE EXPAT::EXPAT TBB::tbb)
