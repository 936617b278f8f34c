// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <vector>

#include "chains.hpp"
#include "dynid/dynamics/dynamics.hpp"
#include "sanitized.hpp"

#if defined(__GLIBC__) && !defined(DYNID_SANITIZED)  // a sanitizer has a malloc of its own
#define DYNID_COUNTS_ALLOCATIONS

// This executable's own malloc and kin, which operator new and Eigen end in too: glibc's, counted.
namespace {
std::atomic<long> allocations{0};
}
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  ++allocations;
  return __libc_calloc(count, size);
}
void* realloc(void* p, std::size_t size) {
  ++allocations;
  return __libc_realloc(p, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  ++allocations;
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  ++allocations;
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** p, std::size_t alignment, std::size_t size) {
  ++allocations;
  *p = __libc_memalign(alignment, size);
  return *p == nullptr ? ENOMEM : 0;
}
}
#endif

namespace dynid::test {
namespace {

#ifdef DYNID_COUNTS_ALLOCATIONS

template <class F>
long counted(const F& f) {
  const long before = allocations;
  f();
  return allocations - before;
}

template <int N, class S>
void none_allocates(const Robot& robot) {
  const Model<N> model(robot);
  const int n = model.size();
  Workspace<N, S> ws(model);
  const auto value = [](double x) {
    if constexpr (std::is_same_v<S, Packet8>)
      return Packet8(Packet8::Constant(x));
    else
      return S(x);
  };
  Eigen::Matrix<S, N, 1> q(n), dq(n), ddq(n), tau(n);
  for (int i = 0; i < n; ++i) q[i] = value(0.1 * i), dq[i] = value(0.2 * i), ddq[i] = value(1.0 - i);
  Eigen::Matrix<S, N, N> M(n, n);
  Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic> Y(n, 10 * n), Ys(n * (n + 1) / 2 + n, 10 * n);
  Eigen::Matrix<S, 6, N> J(6, n);
  const Eigen::VectorXd armature = Eigen::VectorXd::Ones(n);

  EXPECT_EQ(counted([&] { inverse_dynamics(model, ws, q, dq, ddq, tau); }), 0);
  EXPECT_EQ(counted([&] { regressor(model, ws, q, dq, ddq, Y); }), 0);
  EXPECT_EQ(counted([&] { inertia_stack_regressor(model, ws, q, Ys); }), 0);
  EXPECT_EQ(counted([&] { mass_matrix(model, ws, q, M); }), 0);
  EXPECT_EQ(counted([&] { mass_matrix(model, ws, q, M, armature); }), 0);
  EXPECT_EQ(counted([&] { coriolis_matrix(model, ws, q, dq, M); }), 0);
  EXPECT_EQ(counted([&] { gravity(model, ws, q, tau); }), 0);
  EXPECT_EQ(counted([&] { forward_dynamics(model, ws, q, dq, ddq, tau); }), 0);
  EXPECT_EQ(counted([&] { forward_dynamics(model, ws, q, dq, ddq, tau, armature); }), 0);
  EXPECT_EQ(counted([&] { jacobian(model, ws, q, J); }), 0);
  EXPECT_EQ(counted([&] { joint_wrenches(model, ws, q, dq, ddq, J); }), 0);
  EXPECT_EQ(counted([&] { tau[0] = kinetic_energy(model, ws, q, dq) + potential_energy(model, ws, q); }), 0);
  if constexpr (std::is_same_v<S, double>) {
    std::vector<Eigen::Isometry3d> poses(n + 1);
    EXPECT_EQ(counted([&] { forward_kinematics(model, ws, q, poses); }), 0);
  }
}

TEST(Allocation, IsCounted) {
  EXPECT_GE(counted([] { Eigen::VectorXd::Ones(100).eval(); }), 1);
  EXPECT_GE(counted([] { std::vector<int>(100).front() = 1; }), 1);
}

TEST(Allocation, NoneInAnyKernel) {
  none_allocates<7, double>(panda());
  none_allocates<6, double>(ur_like());
  none_allocates<Eigen::Dynamic, double>(random_chain(7));
  none_allocates<7, Packet8>(panda());
  none_allocates<Eigen::Dynamic, Packet8>(random_chain(7));
}

TEST(Allocation, NoneInAFixedModelOrWorkspace) {
  const Robot robot = panda();
  Model<7> model(robot);
  EXPECT_EQ(counted([&] { Workspace<7> ws(model); }), 0);
  EXPECT_EQ(counted([&] { model.set_gravity(Eigen::Vector3d(1, 2, 3)); }), 0);
  EXPECT_EQ(counted([&] { model = model.with_gravity(Eigen::Vector3d(0, 0, -9.81)); }), 0);
  const Eigen::VectorXd pi = Eigen::VectorXd::Ones(70);
  EXPECT_EQ(counted([&] { model.set_parameters(pi); }), 0);
}

#else

constexpr const char* why = "allocations cannot be counted under a sanitizer or without glibc";
TEST(Allocation, IsCounted) { GTEST_SKIP() << why; }
TEST(Allocation, NoneInAnyKernel) { GTEST_SKIP() << why; }
TEST(Allocation, NoneInAFixedModelOrWorkspace) { GTEST_SKIP() << why; }

#endif

}  // namespace
}  // namespace dynid::test
