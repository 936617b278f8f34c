// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <cstddef>

#include "dynamics/chains.hpp"
#include "dynid/estimation/torque_estimator.hpp"
#include "sanitized.hpp"

#if defined(__GLIBC__) && !defined(DYNID_SANITIZED)  // a sanitizer has a malloc of its own
#define DYNID_COUNTS_ALLOCATIONS

// This executable's own malloc, free and kin, which operator new and Eigen end in too: glibc's, counted.
namespace {
std::atomic<long> allocations{0};
}
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);
void free(void* p) {
  if (p != nullptr) ++allocations;
  __libc_free(p);
}
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

template <int N>
void none_in_the_loop(const Robot& robot, ObserverOrder order) {
  const TorqueModel<N> model(robot);
  TorqueModel<N> loaded = model;
  LinkInertia payload;
  payload.mass = 1.0;
  const long before_payload = allocations;
  loaded.set_payload(payload);
  loaded.set_gravity(Eigen::Vector3d(0, 1, -9.7));
  EXPECT_EQ(allocations - before_payload, 0) << robot.name;
  TorqueEstimatorOptions options;
  options.order = order;
  options.uncertainty = Uncertainty();  // one that is passed at once: the wrench of a contact is made too
  options.uncertainty->joints.assign(static_cast<std::size_t>(model.size()), JointUncertainty());
  for (JointUncertainty& joint : options.uncertainty->joints) joint.constant = 1e-4;
  options.uncertainty->correlation = Eigen::MatrixXd::Identity(model.size(), model.size());
  options.uncertainty->period = 1e-3, options.uncertainty->position_noise = 1.0;  // the stamps decide
  options.uncertainty->window = options.uncertainty->motion_bandwidth = 5000.0;   // settled at once
  options.uncertainty->tail = {1e-6, 1e-6, 1.0};
  TorqueEstimator<N> estimator(model, options);
  const int n = model.size();
  Generator generator(5);
  Eigen::Matrix<double, N, 1> q(n), dq(n), tau(n), ddq(n);
  long made = 0, pushed = 0;
  Status all = Status::ok;
  for (int k = 0; k < 2000; ++k) {
    q = random_state(generator, n, 0.5), dq = random_state(generator, n, 0.5);
    tau = random_state(generator, n, 5.0), ddq = random_state(generator, n, 1.0);
    double dt = 1e-3;
    if (k % 100 == 50) q[0] = std::nan("");
    if (k % 100 == 60) dt = -1.0;
    if (k % 100 == 70) dt = 1.0;
    if (k % 100 == 80) dt = 0.0;
    if (k % 200 == 0) estimator.adopt(k % 400 == 0 ? loaded : model);
    const long before = allocations;
    const Status status =
        (k % 2 == 0 ? estimator.step(dt, q, dq, tau) : estimator.step(dt, q, dq, tau, ddq)).status;
    if (k % 500 == 0) estimator.reset();
    made += allocations - before;
    all |= status;
    pushed += estimator.estimate().pushed.detected;
  }
  EXPECT_EQ(made, 0) << robot.name;
  EXPECT_GT(pushed, 0) << robot.name;
  for (const Status flag : {Status::restarted, Status::bad_input, Status::stale, Status::time_went_back,
                            Status::gap, Status::model_changed})
    EXPECT_TRUE(has(all, flag)) << static_cast<unsigned>(flag);
}

TEST(EstimatorAllocation, IsCounted) {
  const long before = allocations;
  delete new Eigen::VectorXd(100);
  EXPECT_GE(allocations - before, 4);
}

TEST(EstimatorAllocation, NoneAndNoFreeInAnyCycle) {
  for (const ObserverOrder order : {ObserverOrder::first, ObserverOrder::second, ObserverOrder::kalman}) {
    none_in_the_loop<7>(panda(), order);
    none_in_the_loop<6>(ur_like(), order);
    none_in_the_loop<Eigen::Dynamic>(panda(), order);
    none_in_the_loop<Eigen::Dynamic>(random_chain(7), order);
  }
}

#else

constexpr const char* why = "allocations cannot be counted under a sanitizer or without glibc";
TEST(EstimatorAllocation, IsCounted) { GTEST_SKIP() << why; }
TEST(EstimatorAllocation, NoneAndNoFreeInAnyCycle) { GTEST_SKIP() << why; }

#endif

}  // namespace
}  // namespace dynid::test
