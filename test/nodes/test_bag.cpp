// SPDX-License-Identifier: Apache-2.0
// Logs in rosbags: what is written is read back, and what a bag should not be is said in one line. No
// roscore.
#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <std_msgs/String.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "identification/synthetic.hpp"
#include "ros/bag.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;
using sensor_msgs::JointState;

/// As ROS stamps them.
Log whole_nanoseconds(Log log) {
  for (double& t : log.t) t = std::round(1e9 * t) / 1e9;
  return log;
}

class Bag : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / (std::string("dynid_bag_") + info->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    for (const Joint& joint : robot_.joints) joints_.push_back(joint.name);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  static Log short_log() { return whole_nanoseconds(test::synthetic_log(test::panda(), 3, 2.0, 250.0, 0.1)); }

  /// A good message, `i` ms after the first.
  JointState message(int i) const {
    JointState m;
    m.header.stamp = ros::Time(100) + ros::Duration(1e-3 * i);
    m.name = joints_;
    for (int j = 0; j < 7; ++j) {
      m.position.push_back(j + 1e-3 * i);
      m.velocity.push_back(1.0);
      m.effort.push_back(-j);
    }
    return m;
  }
  std::vector<JointState> messages(int count) const {
    std::vector<JointState> all;
    for (int i = 0; i < count; ++i) all.push_back(message(i));
    return all;
  }

  /// The line with which the messages, as a bag, are refused.
  std::string refusal(const std::vector<JointState>& all, const LogColumns& required = {}) const {
    write_bag(path("refused.bag"), all);
    return refusal_of(path("refused.bag"), "/joint_states", required);
  }
  std::string refusal_of(const std::string& file, const std::string& topic = "/joint_states",
                         const LogColumns& required = {}) const {
    try {
      read_bag(file, joints_, topic, required);
    } catch (const Error& error) {
      const std::string what = error.what();
      EXPECT_EQ(what.rfind(file, 0), 0u) << what;
      EXPECT_EQ(what.find('\n'), std::string::npos) << what;
      return what;
    }
    return "not refused";
  }

  int run(const std::string& program, const std::string& arguments) {
    const std::string command = program + " " + arguments + " >" + path("stdout") + " 2>" + path("stderr");
    const int status = std::system(command.c_str());
    out_ = read_file(path("stdout"));
    error_ = read_file(path("stderr"));
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  int dynid(const std::string& arguments) { return run(DYNID_PROGRAM, arguments); }
  /// No roscore is to be had at this address.
  int node(const std::string& arguments) {
    const std::string beside = (fs::path(DYNID_PROGRAM).parent_path() / "identification_node").string();
    return run("ROS_MASTER_URI=http://localhost:1 timeout 120 " + beside, arguments);
  }
  static std::string panda() { return std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml"; }

  fs::path folder_;
  const Robot robot_ = test::panda();
  std::vector<std::string> joints_;
  std::string out_, error_;
};

/// A file's lines but for the one that names where the model came from.
std::string without_note(const std::string& file) {
  std::istringstream in(read_file(file));
  std::string text, line;
  while (std::getline(in, line))
    if (line.rfind("note:", 0) != 0) text += line + "\n";
  return text;
}

void expect_same(const Log& a, const Log& b, Eigen::Index samples) {
  ASSERT_EQ(a.samples(), samples);
  EXPECT_EQ(a.t, b.t.head(samples));
  EXPECT_EQ(a.q, b.q.topRows(samples));
  EXPECT_EQ(a.dq, b.dq.topRows(samples));
  EXPECT_EQ(a.tau, b.tau.topRows(samples));
}

TEST_F(Bag, GivesBackWhatWasWritten) {
  const Log log = short_log();
  for (const BagCompression c : {BagCompression::none, BagCompression::bz2, BagCompression::lz4}) {
    write_bag(path("a.bag"), log, joints_, "/joint_states", c);
    std::string warning = "untouched";
    const Log back = read_bag(path("a.bag"), joints_, "joint_states", {}, &warning);
    expect_same(back, log, log.samples());
    EXPECT_EQ(warning, "");
    // And through CSV.
    write_log(path("a.csv"), back);
    expect_same(read_log(path("a.csv")), log, log.samples());
  }
}

TEST_F(Bag, KeepsStampsFarFromZeroToTheNanosecond) {
  std::vector<JointState> all = messages(3);
  for (std::size_t i = 0; i < all.size(); ++i)
    all[i].header.stamp = ros::Time(1700000000, static_cast<std::uint32_t>(999999999 - 2 + i));
  all[2].header.stamp = ros::Time(1700000001, 123456789);
  write_bag(path("a.bag"), all);
  const Log log = read_bag(path("a.bag"), joints_);
  EXPECT_EQ(log.t, Eigen::Vector3d(0.0, 1e-9, 0.123456792));
}

TEST_F(Bag, FindsJointsByNameAmongOthers) {
  std::mt19937 random(5);
  std::vector<JointState> all;
  for (int i = 0; i < 50; ++i) {
    const JointState whole = message(i);
    std::vector<std::size_t> order = {0, 1, 2, 3, 4, 5, 6};
    std::shuffle(order.begin(), order.end(), random);
    JointState m;
    m.header = whole.header;
    for (const std::size_t j : order) {
      m.name.push_back(whole.name[j]);
      m.position.push_back(whole.position[j]);
      m.velocity.push_back(whole.velocity[j]);
      m.effort.push_back(whole.effort[j]);
      if (j != 3) continue;
      m.name.push_back("finger");
      for (auto* values : {&m.position, &m.velocity, &m.effort})
        values->push_back(std::numeric_limits<double>::quiet_NaN());
    }
    all.push_back(m);
    JointState gripper;  // a publisher of its own, later by a little and with less to say
    gripper.header.stamp = m.header.stamp - ros::Duration(0.5);
    gripper.name = {"finger"};
    gripper.position = {0.04};
    all.push_back(gripper);
  }
  write_bag(path("a.bag"), all);
  write_bag(path("b.bag"), messages(50));
  expect_same(read_bag(path("a.bag"), joints_), read_bag(path("b.bag"), joints_), 50);
}

TEST_F(Bag, IsReadWithoutWhatNobodyNeeds) {
  std::vector<JointState> all = messages(10);
  for (JointState& m : all) m.velocity.clear(), m.effort.clear();
  LogColumns none;
  none.dq = none.tau = false;
  write_bag(path("a.bag"), all);
  const Log log = read_bag(path("a.bag"), joints_, "/joint_states", none);
  EXPECT_EQ(log.samples(), 10);
  EXPECT_EQ(log.dq.size(), 0);
  EXPECT_EQ(log.tau.size(), 0);
  EXPECT_NE(refusal(all).find("has no velocity"), std::string::npos);
  none.dq = true;
  for (JointState& m : all) m.velocity.assign(7, 0.0);
  EXPECT_NE(refusal(all).find("has no effort"), std::string::npos);
}

TEST_F(Bag, IsRefusedInOneLine) {
  const auto expect = [this](const std::function<void(std::vector<JointState>&)>& spoil,
                             const std::string& part) {
    std::vector<JointState> all = messages(10);
    spoil(all);
    const std::string what = refusal(all);
    EXPECT_NE(what.find(part), std::string::npos) << what;
    EXPECT_NE(what.find("topic /joint_states"), std::string::npos) << what;
  };
  using All = std::vector<JointState>;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expect([&](All& m) { m[3].position[2] = nan; },
         "message 4: position of joint 'panda_joint3' is not finite");
  expect([&](All& m) { m[3].velocity[0] = HUGE_VAL; }, "message 4: velocity of joint 'panda_joint1' is not");
  expect([&](All& m) { m[3].effort[6] = nan; }, "message 4: effort of joint 'panda_joint7' is not finite");
  expect([](All& m) { m[5].name[1] = "other"; }, "message 6: joint 'panda_joint2' is missing");
  expect([](All& m) { m[5].name[1] = "panda_joint1"; }, "message 6: joint 'panda_joint1' is named twice");
  expect([](All& m) { m[5].position.pop_back(); }, "message 6: position has 6 entries for 7 names");
  expect([](All& m) { m[5].effort.resize(1); }, "message 6: effort has 1 entries for 7 names");
  expect([](All& m) { m[5].velocity.clear(); }, "message 6: velocity is empty here, not before");
  expect([](All& m) { m[0].effort.clear(); }, "message 2: effort is sent here, not before");
  expect([](All& m) { m[7].header.stamp -= ros::Duration(0.5); }, "message 8: time goes back");
  expect(
      [](All& m) {
        for (JointState& one : m) one.header.stamp = ros::Time(0);
      },
      "has no stamps");
  expect(
      [](All& m) {
        for (JointState& one : m)
          for (std::string& name : one.name) name = "ur_" + name;
      },
      "has no message with joint 'panda_joint1' or another of the robot's; there are ur_panda_joint1,");
  // A repeated stamp is none of these.
  std::vector<JointState> repeated = messages(10);
  repeated[4].header.stamp = repeated[3].header.stamp;
  EXPECT_EQ(refusal(repeated), "not refused");
}

TEST_F(Bag, NamesTheTopicsThatThereAre) {
  write_bag(path("a.bag"), messages(3), "/arm/joint_states");
  EXPECT_NE(
      refusal_of(path("a.bag")).find("topic /joint_states is not in the bag; there are /arm/joint_states"),
      std::string::npos);
  EXPECT_EQ(read_bag(path("a.bag"), joints_, "arm/joint_states").samples(), 3);
  {
    rosbag::Bag bag(path("b.bag"), rosbag::bagmode::Write);
    bag.write("/joint_states", ros::Time(1), std_msgs::String());
  }
  EXPECT_NE(refusal_of(path("b.bag")).find("is std_msgs/String, not sensor_msgs/JointState"),
            std::string::npos);
  { rosbag::Bag bag(path("c.bag"), rosbag::bagmode::Write); }
  EXPECT_NE(refusal_of(path("c.bag")).find("is not in the bag, nor is any other"), std::string::npos);
  EXPECT_NE(refusal_of(path("missing.bag")).find("cannot read"), std::string::npos);
  std::ofstream(path("d.bag")) << "t,q1,q2\n0,1,2\n1,2,3\n";
  EXPECT_NE(refusal_of(path("d.bag")).find("not a bag"), std::string::npos);
  std::ofstream(path("e.bag")).close();
  EXPECT_NE(refusal_of(path("e.bag")).find("not a bag: 0 bytes"), std::string::npos);
}

TEST_F(Bag, CutShortIsReadAsFarAsItGoes) {
  const Log log = whole_nanoseconds(test::synthetic_log(test::panda(), 4, 24.0, 250.0, 0.1));  // chunks
  for (const BagCompression c : {BagCompression::none, BagCompression::bz2, BagCompression::lz4}) {
    write_bag(path("whole.bag"), log, joints_, "/joint_states", c);
    const std::string bytes = read_file(path("whole.bag"));
    Eigen::Index last = 0;
    for (int part = 0; part <= 20; ++part) {
      const std::size_t size =
          part == 20 ? bytes.size() - 1 : bytes.size() * static_cast<std::size_t>(part) / 20;
      std::ofstream(path("cut.bag"), std::ios::binary) << bytes.substr(0, size);
      std::string warning;
      try {
        const Log cut = read_bag(path("cut.bag"), joints_, "/joint_states", {}, &warning);
        EXPECT_GE(cut.samples(), last);
        last = cut.samples();
        expect_same(cut, log, last);
        EXPECT_NE(warning.find("not whole"), std::string::npos) << warning;
        EXPECT_NE(warning.find(std::to_string(last) + " messages could be read, up to "), std::string::npos);
        EXPECT_EQ(warning.find('\n'), std::string::npos);
        // Of an uncompressed bag all is read that is there: a message takes 350 bytes, with its record.
        if (c == BagCompression::none) {
          EXPECT_GT(double(last), double(size) / double(bytes.size()) * double(log.samples()) - 100);
        }
      } catch (const Error& error) {  // nothing to be read yet
        EXPECT_EQ(last, 0) << part << " of 20: " << error.what();
        EXPECT_LT(part, c == BagCompression::none ? 2 : 12) << error.what();
      }
    }
    EXPECT_EQ(last, log.samples());

    // As a recorder leaves it that was killed: all there, no index.
    std::string active = bytes;
    const std::string field = "index_pos=";
    active.replace(active.find(field) + field.size(), 8, 8, '\0');
    std::ofstream(path("active.bag"), std::ios::binary) << active;
    std::string warning;
    expect_same(read_bag(path("active.bag"), joints_, "/joint_states", {}, &warning), log, log.samples());
    EXPECT_NE(warning.find("it has no index"), std::string::npos) << warning;
  }
}

TEST_F(Bag, DamagedInAnyByteNeverCrashes) {
  const char* asked = std::getenv("DYNID_TEST_BAGS");
  const int cases = asked != nullptr ? std::atoi(asked) : 300;
  const unsigned seed = 11;
  std::mt19937 random(seed);
  const Log log = short_log();
  std::string whole[3];
  for (int c = 0; c < 3; ++c) {
    write_bag(path("whole.bag"), log, joints_, "/joint_states", static_cast<BagCompression>(c));
    whole[c] = read_file(path("whole.bag"));
  }
  for (int k = 0; k < cases; ++k) {
    std::string bytes = whole[k % 3];
    // Headers and the index are few of the bytes; half of the damage is done there.
    std::uniform_int_distribution<std::size_t> anywhere(0, bytes.size() - 1), start(4096, 6000);
    const int flips = 1 + k % 4;
    for (int i = 0; i < flips; ++i)
      bytes[std::min(bytes.size() - 1, i % 2 == 0 ? anywhere(random) : start(random))] =
          static_cast<char>(random());
    std::ofstream(path("damaged.bag"), std::ios::binary) << bytes;
    SCOPED_TRACE("seed " + std::to_string(seed) + ", case " + std::to_string(k));
    try {
      std::string warning;
      const Log read = read_bag(path("damaged.bag"), joints_, "/joint_states", {}, &warning);
      EXPECT_TRUE(read.q.allFinite() && read.dq.allFinite() && read.tau.allFinite());
      EXPECT_LE(read.samples(), log.samples());
    } catch (const Error& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    }
  }
}

TEST_F(Bag, IsWrittenWholeOrNotAtAll) {
  const Log log = short_log();
  EXPECT_THROW(write_bag(path("no/such/a.bag"), log, joints_), Error);
  Log wrong = log;
  wrong.dq.conservativeResize(3, 7);
  EXPECT_THROW(write_bag(path("a.bag"), wrong, joints_), Error);
  wrong = log;
  wrong.t.resize(0);
  EXPECT_THROW(write_bag(path("a.bag"), wrong, joints_), Error);
  EXPECT_TRUE(fs::is_empty(folder_));
  write_bag(path("a.bag"), log, joints_);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

TEST_F(Bag, IsAsGoodAsCsvToEveryCommand) {
  ASSERT_EQ(dynid("simulate --quiet --model " + panda() + " --excite --duration 12 --seed 2 --out " +
                  path("a.csv")),
            0)
      << error_;
  ASSERT_EQ(dynid("simulate --quiet --model " + panda() +
                  " --excite --duration 12 --seed 2 --compression lz4 --topic /arm --out " + path("a.bag")),
            0)
      << error_;
  const std::string bag = " --topic /arm --log " + path("a.bag"), csv = " --log " + path("a.csv");
  // Stamps of a simulated log are finer than a nanosecond: the models agree as closely as these do.
  for (const auto& [log, name] : {std::pair(bag, "b"), std::pair(csv, "c")}) {
    const std::string out = path(name);
    ASSERT_EQ(dynid("identify --quiet --robot " + panda() + log + " --out " + out + ".yaml --json " + out +
                    ".json"),
              0)
        << error_;
    ASSERT_EQ(dynid("torque --quiet --model " + panda() + log + " --out " + out + "t.csv"), 0) << error_;
    ASSERT_EQ(dynid("diagnose --quiet --model " + panda() + log + " --json " + out + "d.json"), 0) << error_;
    ASSERT_LT(dynid("retrieve --quiet --robot " + panda() + log + " --bounds " + DYNID_SOURCE_DIR +
                    "/config/panda_bounds.yaml --runs 1 --steps 1 --json " + out + "r.json"),
              2)
        << error_;
  }
  const auto b = nlohmann::json::parse(read_file(path("b.json"))),
             c = nlohmann::json::parse(read_file(path("c.json")));
  ASSERT_EQ(b["coefficients"].size(), c["coefficients"].size());
  for (std::size_t k = 0; k < b["coefficients"].size(); ++k) {
    const double value = c["coefficients"][k]["value"];
    EXPECT_NEAR(b["coefficients"][k]["value"], value, 1e-6 * (1.0 + std::abs(value)))
        << c["coefficients"][k]["name"];
  }
  EXPECT_EQ(nlohmann::json::parse(read_file(path("bd.json")))["verdict"],
            nlohmann::json::parse(read_file(path("cd.json")))["verdict"]);

  EXPECT_EQ(dynid("identify --robot " + panda() + " --log " + path("a.bag") + " --out " + path("x.yaml")), 2);
  EXPECT_NE(error_.find("there are /arm"), std::string::npos) << error_;
  EXPECT_EQ(std::count(error_.begin(), error_.end(), '\n'), 1) << error_;
  EXPECT_FALSE(fs::exists(path("x.yaml")));
  EXPECT_EQ(dynid("torque --model " + panda() + bag + " --out " + path("x.bag")), 2);
  EXPECT_EQ(
      dynid("simulate --model " + panda() + " --trajectory " + path("a.bag") + " --out " + path("x.csv")), 2);

  // Cut in the middle: a warning, and a model.
  const std::string bytes = read_file(path("a.bag"));
  std::ofstream(path("cut.bag"), std::ios::binary) << bytes.substr(0, bytes.size() * 3 / 4);
  EXPECT_EQ(dynid("identify --quiet --robot " + panda() + " --topic /arm --log " + path("cut.bag") +
                  " --out " + path("x.yaml")),
            0);
  EXPECT_NE(error_.find("dynid: warning: " + path("cut.bag") + ": the bag is not whole"), std::string::npos)
      << error_;
  EXPECT_TRUE(fs::exists(path("x.yaml")));
}

TEST_F(Bag, TheNodeIdentifiesAsTheProgramDoes) {
  const Log log =
      whole_nanoseconds(test::synthetic_log(test::with_linear_friction(robot_), 1, 20.0, 100.0, 0.01));
  write_log(path("a.csv"), log);
  write_bag(path("a.bag"), log, joints_, "/joint_states", BagCompression::bz2);
  ASSERT_EQ(dynid("identify --quiet --robot " + panda() + " --log " + path("a.csv") + " --cutoff 10 --out " +
                  path("c.yaml")),
            0)
      << error_;
  ASSERT_EQ(node("_bag:=" + path("a.bag") + " _model:=" + panda() +
                 " _cutoff:=10 _output_directory:=" + path("out") + " _bounds:=" + DYNID_SOURCE_DIR +
                 "/config/panda_bounds.yaml _runs:=2 _steps:=3"),
            0)
      << error_;
  EXPECT_TRUE(without_note(path("out/identified.yaml")) == without_note(path("c.yaml")));
  EXPECT_NE(out_.find("Identified 64 coefficients"), std::string::npos) << out_;
  EXPECT_NE(out_.find("Verdict:"), std::string::npos) << out_;
  const auto result = nlohmann::json::parse(read_file(path("out/result.json")));
  EXPECT_EQ(result["status"], 0);
  EXPECT_EQ(result["adoptable"], path("out/feasible.yaml"));
  EXPECT_EQ(result["diagnosis"]["format"], "dynid-diagnosis-1");
  for (const auto& file : result["files"]) EXPECT_TRUE(fs::exists(file.get<std::string>())) << file;
  EXPECT_NE(read_file(path("out/report.html")).find("<html"), std::string::npos);
}

TEST_F(Bag, TheNodeIdentifiesARecordedPandaAsTheProgramDoes) {
  const char* data = std::getenv("DYNID_DATA");
  if (data == nullptr) GTEST_SKIP() << "DYNID_DATA is not set: panda_real/exciting.csv is not there";
  const std::string csv = std::string(data) + "/panda_real/exciting.csv";
  const Log log = read_log(csv, 7);
  ASSERT_EQ(dynid("identify --quiet --robot " + panda() + " --log " + csv + " --out " + path("c.yaml")), 0)
      << error_;
  for (const BagCompression c : {BagCompression::none, BagCompression::lz4}) {
    write_bag(path("a.bag"), log, joints_, "/joint_states", c);
    ASSERT_EQ(node("_bag:=" + path("a.bag") + " _model:=" + panda() +
                   " _diagnose:=false _output_directory:=" + path("out")),
              0)
        << error_;
    EXPECT_TRUE(without_note(path("out/identified.yaml")) == without_note(path("c.yaml")));
  }
}

TEST_F(Bag, TheNodeSaysInOneLineWhatIsWrong) {
  write_bag(path("a.bag"), messages(100));
  write_bag(path("b.bag"), messages(100), "/arm");
  const std::string out = " _output_directory:=" + path("out"), model = " _model:=" + panda();
  const auto refused = [this](const std::string& arguments, const std::string& part) {
    EXPECT_EQ(node(arguments), 2) << arguments;
    EXPECT_NE(error_.find(part), std::string::npos) << error_;
    EXPECT_EQ(std::count(error_.begin(), error_.end(), '\n'), 1) << error_;
    EXPECT_FALSE(fs::exists(path("out/identified.yaml")));
    EXPECT_FALSE(fs::exists(path("out/result.json")));
  };
  refused("_bag:=" + path("a.bag") + out, "~model");
  refused("_bag:=" + path("no.bag") + model + out, "no.bag");
  refused("_bag:=" + path("b.bag") + model + out, "there are /arm");
  refused("_bag:=" + path("a.bag") + model + out, "a.bag");  // a tenth of a second
  refused("_bag:=" + path("a.bag") + model + out + " _cutoff:=-1", "~cutoff: -1 is negative");
  refused("_bag:=" + path("a.bag") + model + out + " _frction:=none", "frction");
  refused("_bag:=" + path("a.bag") + model + out + " _diagnose:=maybe", "diagnose");
  refused("_bag:=" + path("a.bag") + " _model:=/no/such.yaml" + out, "/no/such.yaml");
}

}  // namespace
}  // namespace dynid
