# SPDX-License-Identifier: Apache-2.0
#
# The laws of the kernels once more with four lanes (AVX2): groups of joints then overlap otherwise than in the default
# build. Only where the machine has it.
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64" AND NOT DYNID_SANITIZE)
  include(CheckCXXSourceRuns)
  check_cxx_source_runs("int main() { return !(__builtin_cpu_supports(\"avx2\") && __builtin_cpu_supports(\"fma\")); }"
    DYNID_RUNS_AVX2)
  if(DYNID_RUNS_AVX2)
    add_executable(test_dynamics_v3 dynamics/test_laws.cpp dynamics/test_scalars.cpp)
    # As the library is compiled without AVX, Eigen's types keep the alignment that they have there.
    target_compile_options(test_dynamics_v3 PRIVATE -march=x86-64-v3)
    target_compile_definitions(test_dynamics_v3 PRIVATE DYNID_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
      EIGEN_MAX_ALIGN_BYTES=16 EIGEN_MAX_STATIC_ALIGN_BYTES=16)
    target_include_directories(test_dynamics_v3 PRIVATE "${CMAKE_CURRENT_SOURCE_DIR}")
    target_link_libraries(test_dynamics_v3 PRIVATE dynid dynid_warnings GTest::gtest GTest::gtest_main)
    add_cases(dynamics_v3 test_dynamics_v3 0)
  endif()
endif()
