// SPDX-License-Identifier: Apache-2.0
// Another thread hands over models while the loop runs; for the thread sanitizer too.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "dynamics/chains.hpp"
#include "dynid/estimation/torque_estimator.hpp"

namespace dynid::test {
namespace {

using Vector7 = Eigen::Matrix<double, 7, 1>;

TEST(TripleBuffer, ReaderSeesWholeValuesInOrderAndTheLast) {
  struct Block {
    long number;
    long copies[200];
  };
  const auto block = [](long number) {
    Block b;
    b.number = number;
    for (long& c : b.copies) c = number;
    return b;
  };
  TripleBuffer<Block> buffer(block(0));
  EXPECT_FALSE(buffer.update());
  const long last = 200000;
  std::thread writer([&] {
    for (long k = 1; k <= last; ++k) buffer.publish(block(k));
  });
  long seen = 0, torn = 0, backwards = 0;
  while (seen < last) {
    if (!buffer.update()) continue;
    const Block& b = buffer.front();
    if (b.number <= seen) ++backwards;
    seen = b.number;
    for (const long c : b.copies)
      if (c != b.number) ++torn;
  }
  writer.join();
  EXPECT_EQ(torn, 0);
  EXPECT_EQ(backwards, 0);
  EXPECT_FALSE(buffer.update());
}

template <int N>
void swap_while_running() {
  const Robot robot = panda();
  LinkInertia payload;
  payload.mass = 1.0;
  payload.com = Eigen::Vector3d(0, 0, 0.1);
  const TorqueModel<N> bare(robot);
  TorqueModel<N> loaded = bare;
  loaded.set_payload(payload);
  TorqueEstimator<N> estimator(bare);

  Workspace<N> ws(bare.rigid_body());
  Eigen::Matrix<double, N, 1> q(7), dq(7), ddq(7), tau_f(7), with(7), without(7);
  q << 0.1, -0.5, 0.2, -1.8, 0.3, 1.9, 0.4;
  dq << 0.3, 0.2, -0.4, 0.1, 0.5, -0.3, 0.2;
  ddq.setZero();
  bare.friction(q, dq, tau_f);
  bare.torque(ws, q, dq, ddq, tau_f, without);
  loaded.torque(ws, q, dq, ddq, tau_f, with);

  std::atomic<bool> done{false};
  std::thread other([&] {
    for (int k = 0; k < 3000; ++k) {
      estimator.adopt(k % 2 == 0 ? loaded : bare);
      std::this_thread::yield();
    }
    done = true;
  });
  long changes = 0, neither = 0;
  for (long k = 0; !done || k < 1000; ++k) {
    q[0] += 1e-9;  // a sample of its own
    const Estimate<N>& e = estimator.step(1e-3, q, dq, without, ddq);
    if (has(e.status, Status::model_changed)) ++changes;
    if (!((e.tau_model - with).norm() < 1e-2) && !((e.tau_model - without).norm() < 1e-2)) ++neither;
    if (k % 64 == 0) std::this_thread::yield();
  }
  other.join();
  EXPECT_GT(changes, 0);
  EXPECT_EQ(neither, 0);  // always one model whole or the other
  // The last one handed over is the one in use.
  q[0] += 1e-9;
  EXPECT_LT((estimator.step(1e-3, q, dq, without, ddq).tau_model - without).norm(), 1e-2);
}

TEST(HotSwap, EveryCycleHasOneWholeModel) {
  swap_while_running<7>();
  swap_while_running<Eigen::Dynamic>();
}

}  // namespace
}  // namespace dynid::test
