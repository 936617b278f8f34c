// SPDX-License-Identifier: Apache-2.0
//
// What torque_estimator_node does with a message and with tf, without a roscore. The number of random
// messages is DYNID_MESSAGES (100000); DYNID_SEED chooses them.
#include <geometry_msgs/TransformStamped.h>
#include <gtest/gtest.h>
#include <tf2/buffer_core.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <limits>
#include <memory>
#include <random>
#include <thread>

#include "dynid/base/error.hpp"
#include "dynid/dynamics/gravity.hpp"
#include "nodes/arm.hpp"
#include "ros/estimator_core.hpp"
#include "ros/estimator_diagnostics.hpp"
#include "ros/estimator_frames.hpp"
#include "ros/message_reading.hpp"
#include "ros/reading_watch.hpp"

namespace dynid {
namespace {

using sensor_msgs::JointState;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

long from_environment(const char* name, long usual) {
  const char* const text = std::getenv(name);
  return text != nullptr ? std::atol(text) : usual;
}

const Robot& panda() {
  static const Robot robot = read_robot(DYNID_SOURCE_DIR "/config/panda.yaml");
  return robot;
}

std::vector<std::string> joints() {
  std::vector<std::string> names;
  for (const Joint& joint : panda().joints) names.push_back(joint.name);
  return names;
}

ros::Time stamp_of(double t) {
  ros::Time stamp;
  stamp.sec = static_cast<std::uint32_t>(t);
  stamp.nsec = static_cast<std::uint32_t>((t - std::floor(t)) * 1e9);
  return stamp;
}

bool finite(const EstimatorAnswer& answer) {
  const Estimate<>& e = *answer.estimate;
  return e.tau_model.allFinite() && e.tau_friction.allFinite() && e.tau_external.allFinite() &&
         e.residual.allFinite() && answer.wrench.allFinite();
}

class Messages : public testing::Test {
 protected:
  /// The next message of an arm at 1 kHz.
  JointState& next() {
    time_ += 0.001;
    JointState& message = arm_.at(time_);
    message.header.stamp = stamp_of(time_);
    ++message.header.seq;
    return message;
  }
  const EstimatorAnswer& handle(const JointState& message) { return core_.handle(message, time_); }
  void settle() {
    for (int k = 0; k < 200; ++k) handle(next());
    ASSERT_EQ(handle(next()).withheld, Withheld::none);
  }

  test::Arm arm_{panda()};
  EstimatorCore core_{TorqueModel<>(panda()), joints(), {}};
  double time_ = 1000.0;
};

TEST_F(Messages, SettlesForFiveTimeConstants) {
  for (int k = 0; k < 84; ++k) EXPECT_EQ(handle(next()).withheld, Withheld::settling) << k;
  EXPECT_EQ(handle(next()).withheld, Withheld::none);
}

TEST_F(Messages, SaysWhichJoint) {
  settle();
  JointState m = next();
  m.name[3] = "other";
  EXPECT_EQ(handle(m).withheld, Withheld::joint_missing);
  EXPECT_EQ(handle(m).joint, 3);
  m = next();
  m.name[6] = m.name[2];
  EXPECT_EQ(handle(m).withheld, Withheld::joint_missing);
  EXPECT_EQ(handle(m).joint, 6);
  m = next();
  m.name.push_back(m.name[1]);
  EXPECT_EQ(handle(m).withheld, Withheld::joint_twice);
  EXPECT_EQ(handle(m).joint, 1);
  m = next();
  m.effort.resize(5);
  EXPECT_EQ(handle(m).withheld, Withheld::incomplete);
  EXPECT_EQ(handle(m).joint, 5);
  m = next();
  m.velocity[4] = -infinite;
  EXPECT_EQ(handle(m).withheld, Withheld::bad_value);
  EXPECT_EQ(handle(m).joint, 4);
  EXPECT_EQ(handle(JointState()).withheld, Withheld::other_joints);
  EXPECT_EQ(handle(next()).withheld, Withheld::none);
  EXPECT_NEAR(core_.handle(next(), time_).estimate->residual.norm(), 0.0, 0.1);
}

TEST_F(Messages, Stamps) {
  settle();
  JointState m = next();
  m.header.stamp = ros::Time();
  EXPECT_EQ(handle(m).withheld, Withheld::no_stamp);
  EXPECT_EQ(handle(next()).withheld, Withheld::none);
  EXPECT_EQ(handle(arm_.at(time_)).withheld, Withheld::repeated);
  // As far ahead as there are stamps, and back again.
  m = next();
  m.header.stamp.sec = m.header.stamp.nsec = 0xffffffffu;
  EXPECT_EQ(handle(m).withheld, Withheld::gap);
  EXPECT_EQ(handle(next()).withheld, Withheld::time_went_back);
  EXPECT_EQ(handle(next()).withheld, Withheld::settling);
  settle();
  EXPECT_EQ(core_.handle(next(), time_ + 1.0).withheld, Withheld::too_old);
  EXPECT_EQ(core_.handle(next(), time_ - 1.0).withheld, Withheld::too_old);
  EXPECT_EQ(core_.handle(next(), 0.0).withheld, Withheld::none) << "a clock that does not run yet";
  time_ += 0.2;
  EXPECT_EQ(handle(next()).withheld, Withheld::gap);
  settle();
}

TEST_F(Messages, LostMessagesAreCounted) {
  settle();
  for (int k = 0; k < 10; ++k) next();
  handle(next());
  EXPECT_EQ(core_.record().dropped, 10u);
  JointState m = next();
  m.header.seq = 0;  // another publisher
  handle(m);
  EXPECT_EQ(core_.record().dropped, 10u);
}

/// The message as someone with other habits would have sent it: read as `a` says, it is `m` again.
JointState misread(const Assumptions& a, const Robot& robot, JointState m) {
  const Model<> model(robot);
  Workspace<> ws(model);
  const Eigen::VectorXd q = Eigen::Map<const Eigen::VectorXd>(m.position.data(), robot.size());
  Eigen::VectorXd g(robot.size());
  gravity(model, ws, q, g);
  for (int j = 0; j < robot.size(); ++j) {
    const auto i = static_cast<std::size_t>(j);
    const double sign = a.joint_sign.size() ? a.joint_sign[j] : 1.0;
    if (a.without_gravity) m.effort[i] -= g[j];
    m.effort[i] *= sign * (a.torque_sign.size() ? a.torque_sign[j] : 1.0) /
                   (a.torque_factor.size() ? a.torque_factor[j] : 1.0);
    m.position[i] = (m.position[i] - (a.zero.size() ? a.zero[j] : 0.0)) * sign / a.position_unit;
    m.velocity[i] *= sign / a.velocity_unit;
  }
  return m;
}

TEST_F(Messages, ReadAsAssumedAreAnsweredAsThoseMeantSo) {
  for (const char* text :
       {"torque_sign=-1", "joint_sign=1,-1,1,1,-1,1,1", "joint_zero=0,1.5707963,0,-1.5707963,0,0,3.1415926",
        "position_unit=deg,velocity_unit=deg/s", "torque_unit=Nmm",
        "torque_is_motor_side=100,100,80,80,50,50,50", "torque_without_gravity=1",
        "position_unit=deg,velocity_unit=deg/s,joint_sign=-1,joint_zero=0,0,0,1.5707963,0,0,0,torque_sign=-1,"
        "torque_without_gravity=1"}) {
    const Assumptions a = parse_stream_assumptions(text, 7);
    EstimatorCoreOptions options;
    options.reading = MessageReading(a, panda());
    EXPECT_TRUE(options.reading.changes()) << text;
    EstimatorCore other(TorqueModel<>(panda()), joints(), options);
    for (int k = 0; k < 400; ++k) {
      const JointState& m = next();
      const EstimatorAnswer& right = handle(m);
      const EstimatorAnswer& read = other.handle(misread(a, panda(), m), time_);
      if (k < 200) continue;
      ASSERT_EQ(read.withheld, right.withheld) << text;
      ASSERT_LT((read.estimate->residual - right.estimate->residual).norm(), 1e-6) << text;
      ASSERT_LT((read.estimate->tau_model - right.estimate->tau_model).norm(), 1e-6) << text;
    }
  }
  EXPECT_FALSE(MessageReading(parse_stream_assumptions("gravity=9.81,0,0", 7), panda()).changes());
}

TEST(MessageReading, RefusesWhatNoSampleCanBeReadWith) {
  for (const auto& [text, part] : std::vector<std::pair<std::string, std::string>>{
           {"auto", "auto: a single sample"},
           {"time_unit=ms", "time_unit: the stamps of messages are in seconds"},
           {"joint_order=2,1,3,4,5,6,7", "joint_order: joints are found by name"},
           {"velocity_unit=from_position", "velocity_unit: from_position"},
           {"torque_is_magnitude=1", "torque_is_magnitude: "},
           {"colour=red", "colour: unknown"}}) {
    std::string message = "no error";
    try {
      MessageReading(parse_stream_assumptions(text, 7), panda());
    } catch (const Error& error) {
      message = error.what();
    }
    EXPECT_NE(message.find(part), std::string::npos) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
}

/// Samples of an arm in motion for `duration` [s], read wrong as `text` says; what the watch says of them.
std::string watched(const std::string& text, double duration, double window) {
  test::Arm arm(panda());
  arm.amplitude = 0.8;
  const Assumptions a = parse_stream_assumptions(text, 7);
  ReadingWatch watch(7, window);
  const auto vector = [](const std::vector<double>& x) {
    return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(x.data(), 7));
  };
  for (int k = 0; k < duration * 250.0; ++k) {
    const double t = 0.004 * k;
    const JointState m = misread(a, panda(), arm.at(t));
    watch.add({1000.0 + t, vector(m.position), vector(m.velocity), vector(m.effort)});
    watch.ask(panda());
  }
  EXPECT_EQ(watch.asked(), window > 0.0 && duration > 0.25 * window);
  return watch.text();
}

TEST(ReadingWatch, SaysWhatTheMessagesMean) {
  EXPECT_EQ(watched("", 70.0, 60.0), "");
  const std::string turned = watched("torque_sign=-1", 20.0, 60.0);
  EXPECT_NE(turned.find("give ~assume torque_sign=-1"), std::string::npos) << turned;
  EXPECT_EQ(turned.find('\n'), std::string::npos);
  const std::string degrees = watched("position_unit=deg,velocity_unit=deg/s", 20.0, 60.0);
  EXPECT_NE(degrees.find("position_unit=deg,velocity_unit=deg/s"), std::string::npos) << degrees;
  EXPECT_EQ(watched("torque_sign=-1", 10.0, 60.0), "");
  EXPECT_EQ(watched("torque_sign=-1", 70.0, 0.0), "");
}

TEST(ReadingWatch, StartsAnewWhereTimeGoesBackAndLeavesOutWhatIsNoNumber) {
  ReadingWatch watch(1, 40.0);
  const auto one = [](double x) { return Eigen::VectorXd::Constant(1, x); };
  for (int k = 0; k <= 9; ++k) watch.add({double(k), one(0.1 * k), one(0.1), one(1.0)});
  EXPECT_FALSE(watch.due());
  watch.add({10.5, one(nan), one(0.1), one(1.0)});
  EXPECT_FALSE(watch.due());
  watch.add({10.5, one(1.0), one(0.1), one(1.0)});
  EXPECT_TRUE(watch.due());
  watch.add({3.0, one(1.0), one(0.1), one(1.0)});
  EXPECT_FALSE(watch.due());
}

TEST_F(Messages, ResetForgets) {
  settle();
  core_.reset();
  EXPECT_EQ(handle(next()).withheld, Withheld::settling);
  settle();
}

// Harmless changes are answered with the arm's own torques, broken messages never.
TEST_F(Messages, RandomChanges) {
  const long count = from_environment("DYNID_MESSAGES", 100000);
  const auto seed = static_cast<std::uint64_t>(from_environment("DYNID_SEED", 1));
  std::mt19937_64 random(seed);
  const auto choose = [&](std::size_t n) {
    return std::uniform_int_distribution<std::size_t>(0, n - 1)(random);
  };
  const double broken_values[] = {nan, infinite, -infinite, 1e300, -1e7};
  long answered = 0;
  settle();
  for (long k = 0; k < count; ++k) {
    JointState m = next();
    const std::string what = "seed " + std::to_string(seed) + ", message " + std::to_string(k);
    if (choose(3) == 0) {  // permuted
      for (std::size_t i = m.name.size(); i-- > 1;) {
        const std::size_t j = choose(i + 1);
        std::swap(m.name[i], m.name[j]), std::swap(m.position[i], m.position[j]);
        std::swap(m.velocity[i], m.velocity[j]), std::swap(m.effort[i], m.effort[j]);
      }
    }
    if (choose(5) == 0) {  // more joints, with nothing to say
      const auto at = static_cast<std::ptrdiff_t>(choose(m.name.size() + 1));
      m.name.insert(m.name.begin() + at, "finger");
      for (auto* values : {&m.position, &m.velocity, &m.effort}) values->insert(values->begin() + at, nan);
    }
    if (choose(7) == 0) m.velocity.resize(m.velocity.size() + choose(100), nan);
    bool broken = true;
    std::vector<double>* const values[] = {&m.position, &m.velocity, &m.effort};
    const auto of_arm = [&] {
      return static_cast<std::size_t>(std::find(m.name.begin(), m.name.end(), joints()[choose(7)]) -
                                      m.name.begin());
    };
    switch (choose(200)) {
      case 0:
        m.name[of_arm()].clear();
        break;
      case 1:
        m.name.push_back(m.name[of_arm()]);
        break;
      case 2:
        values[choose(3)]->clear();
        break;
      case 3:
        values[choose(3)]->resize(choose(7));
        break;
      case 4:
        (*values[choose(3)])[of_arm()] = broken_values[choose(5)];
        break;
      case 5:
        m.header.stamp = ros::Time();
        break;
      case 6:
        m.name.assign(choose(20), "x");
        break;
      case 7:
        handle(m);  // twice
        break;
      case 8:
        m.header.stamp = choose(20) == 0 ? stamp_of(time_ - 1.0) : ros::Time();
        break;
      case 9:
        if (choose(20) != 0) {
          m.name.clear();
          break;
        }
        m.header.stamp.sec = static_cast<std::uint32_t>(random());
        m.header.stamp.nsec = static_cast<std::uint32_t>(random());
        break;
      default:
        broken = false;
    }
    m.header.seq = choose(50) == 0 ? static_cast<std::uint32_t>(random()) : m.header.seq;
    const EstimatorAnswer& answer = handle(m);
    if (broken) {
      ASSERT_NE(answer.withheld, Withheld::none) << what;
    } else if (answer.withheld == Withheld::none) {
      ++answered;
      ASSERT_LT(answer.estimate->residual.cwiseAbs().maxCoeff(), 0.2) << what;
      ASSERT_LT((answer.estimate->tau_model - arm_.tau()).cwiseAbs().maxCoeff(), 1.0) << what;
      ASSERT_FALSE(answer.estimate->contact.any()) << what;
    }
    if (k % 1000 == 0) core_.record();
  }
  EXPECT_GT(answered, count * 6 / 10) << "of " << count;
  const EstimatorRecord& record = core_.record();
  handle(next());
  for (const Withheld why : {Withheld::other_joints, Withheld::joint_missing, Withheld::joint_twice,
                             Withheld::incomplete, Withheld::no_stamp, Withheld::bad_value,
                             Withheld::repeated, Withheld::time_went_back, Withheld::gap, Withheld::settling})
    EXPECT_GT(record.withheld[static_cast<std::size_t>(why)], 0u) << describe(why);
}

// Anything at all, while everything is changed from another thread.
TEST_F(Messages, RandomGarbageUnderChanges) {
  const long count = from_environment("DYNID_MESSAGES", 100000);
  const auto seed = static_cast<std::uint64_t>(from_environment("DYNID_SEED", 1)) + 1;
  std::mt19937_64 random(seed);
  const auto choose = [&](std::size_t n) {
    return std::uniform_int_distribution<std::size_t>(0, n - 1)(random);
  };
  const auto number = [&] {
    const std::uint64_t bits = random();
    double any;
    static_assert(sizeof any == sizeof bits);
    std::memcpy(&any, &bits, sizeof any);
    return choose(3) == 0 ? any : std::uniform_real_distribution<double>(-3.0, 3.0)(random);
  };

  std::atomic<bool> done{false};
  std::thread other([&] {
    LinkInertia payload;
    TorqueEstimatorOptions options;
    WrenchFrame frame;
    EstimatorDiagnostics diagnostics(joints(), "/joint_states", 0.5);
    for (int k = 0; !done; ++k) {
      TorqueModel<> model(panda());
      payload.mass = k % 3;
      model.set_payload(payload);
      core_.adopt(model);
      options.gain = Eigen::VectorXd::Constant(1, 10.0 + k % 100);
      core_.retune(options);
      frame.link = k % 9 - 1;
      frame.known = k % 10 != 0;
      core_.set_wrench_frame(frame);
      if (k % 100 == 0) core_.reset();
      diagnostics.begin(core_.record(), k, 1);
      diagnostic_updater::DiagnosticStatusWrapper input, output;
      diagnostics.input(input);
      diagnostics.output(output, Eigen::VectorXd::Constant(7, 1.0));
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
  });
  const std::vector<std::string> names = joints();
  for (long k = 0; k < count; ++k) {
    JointState m = next();
    if (choose(2) == 0) {
      if (choose(4) == 0) {
        m.name.resize(choose(20));
        for (std::string& name : m.name)
          name = choose(5) == 0 ? std::string(choose(100), 'x') : names[choose(7)];
      }
      for (auto* values : {&m.position, &m.velocity, &m.effort}) {
        if (choose(4) == 0) values->resize(choose(20));
        for (double& x : *values)
          if (choose(4) == 0) x = number();
      }
      if (choose(10) == 0) {
        m.header.stamp.sec = static_cast<std::uint32_t>(random());
        m.header.stamp.nsec = static_cast<std::uint32_t>(random());
      }
    }
    const EstimatorAnswer& answer = core_.handle(m, choose(50) == 0 ? number() : time_);
    if (answer.withheld == Withheld::none && !finite(answer)) {
      ADD_FAILURE() << "not finite: seed " << seed << ", message " << k;
      break;
    }
  }
  done = true;
  other.join();
  core_.adopt(TorqueModel<>(panda()));
  core_.retune({});
  settle();
}

// ------------------------------------------------------------------------------------------------ tf
geometry_msgs::TransformStamped transform(const std::string& parent, const std::string& child,
                                          const Eigen::Vector3d& at, const Eigen::Quaterniond& turn,
                                          double time = 0.0) {
  geometry_msgs::TransformStamped t;
  t.header.frame_id = parent, t.child_frame_id = child;
  t.header.stamp = stamp_of(time);
  t.transform.translation.x = at.x(), t.transform.translation.y = at.y(), t.transform.translation.z = at.z();
  t.transform.rotation.w = turn.w(), t.transform.rotation.x = turn.x();
  t.transform.rotation.y = turn.y(), t.transform.rotation.z = turn.z();
  return t;
}

TEST(Frames, GravityFollowsTheBase) {
  tf2::BufferCore tf;
  EstimatorFrames frames(panda(), {});
  EXPECT_TRUE(frames.needs_tf());
  EXPECT_FALSE(frames.update(tf));
  EXPECT_FALSE(frames.gravity_known());
  EXPECT_EQ(frames.gravity(), panda().gravity);
  for (int k = 0; k <= 90; k += 10) {
    const double angle = M_PI / 180.0 * k;
    tf.setTransform(
        transform("world", "panda_link0", {1, 2, 3},
                  Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitX())), 100.0 + k),
        "test");
    EXPECT_TRUE(frames.update(tf)) << k;
    EXPECT_TRUE(frames.gravity_known());
    EXPECT_NEAR((frames.gravity() - 9.81 * Eigen::Vector3d(0.0, -std::sin(angle), -std::cos(angle))).norm(),
                0.0, 1e-9)
        << k;
    EXPECT_FALSE(frames.update(tf)) << "nothing has changed";
  }
}

TEST(Frames, GravityGivenOrTheModels) {
  EstimatorFramesOptions options;
  options.gravity = Eigen::Vector3d(1.0, 2.0, 3.0);
  const EstimatorFrames given(panda(), options);
  EXPECT_FALSE(given.needs_tf());
  EXPECT_TRUE(given.gravity_known());
  EXPECT_EQ(given.gravity(), *options.gravity);
  options.gravity.reset();
  options.gravity_frame.clear();
  const EstimatorFrames own(panda(), options);
  EXPECT_FALSE(own.needs_tf());
  EXPECT_TRUE(own.gravity_known());
  EXPECT_EQ(own.gravity(), panda().gravity);
}

TEST(Frames, WrenchFrameIsCarriedByItsNearestLink) {
  tf2::BufferCore tf;
  const Eigen::Quaterniond none = Eigen::Quaterniond::Identity();
  EstimatorFramesOptions options;
  options.gravity_frame.clear();
  options.prefix = "left/";
  const auto frame_of = [&](const std::string& name) {
    options.wrench_frame = name;
    EstimatorFrames frames(panda(), options);
    frames.update(tf);
    return frames.wrench_frame();
  };
  EXPECT_EQ(frame_of("").link, 7);
  EXPECT_EQ(frame_of("left/panda_link0").link, -1);
  EXPECT_EQ(frame_of("left/panda_link3").link, 2);
  EXPECT_FALSE(frame_of("tool").known);
  tf.setTransform(transform("left/panda_link8", "left/hand", {0, 0, 0.1}, none), "test", true);
  EXPECT_FALSE(frame_of("tool").known);
  tf.setTransform(transform("left/hand", "tool", {0, 0.2, 0}, none), "test", true);
  EXPECT_TRUE(frame_of("tool").known);
  EXPECT_EQ(frame_of("tool").link, 7);
  EXPECT_NEAR((frame_of("tool").pose.translation() - Eigen::Vector3d(0, 0.2, 0.1)).norm(), 0.0, 1e-12);
  // A table beside the robot: both stand in the world.
  tf.setTransform(transform("world", "left/panda_link0", {0, 0, 1}, none), "test", true);
  tf.setTransform(transform("world", "table", {0.5, 0, 0.8}, none), "test", true);
  EXPECT_TRUE(frame_of("table").known);
  EXPECT_EQ(frame_of("table").link, -1);
  EXPECT_NEAR((frame_of("table").pose.translation() - Eigen::Vector3d(0.5, 0, -0.2)).norm(), 0.0, 1e-12);
  // One that moves, and is not on the arm.
  options.wrench_frame = "cart";
  EstimatorFrames frames(panda(), options);
  tf.setTransform(transform("world", "cart", {1, 0, 0}, none, 10.0), "test");
  frames.update(tf);
  EXPECT_TRUE(frames.wrench_frame().known);
  tf.setTransform(transform("world", "cart", {1.1, 0, 0}, none, 11.0), "test");
  frames.update(tf);
  EXPECT_FALSE(frames.wrench_frame().known);
  frames.update(tf);
  EXPECT_FALSE(frames.wrench_frame().known);
}

}  // namespace
}  // namespace dynid
