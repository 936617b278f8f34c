// SPDX-License-Identifier: Apache-2.0
#include "dynid/model/robot_file.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "dynid/base/file.hpp"
#include "dynid/model/urdf.hpp"
#include "dynid/model/yaml.hpp"
#include "random_robot.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;
using test::error_of;

class RobotFile : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (fs::temp_directory_path() / "dynid-XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    folder = pattern;
    test::Random random(1);
    model.robot = test::random_robot(random, 3);
    model.note = "a note";
    model.coefficients = {{"zz1", "zz1", 1.0, 2.0, true}};
  }
  void TearDown() override { fs::remove_all(folder); }

  std::string at(const char* name) const { return (folder / name).string(); }
  void break_a_link() {
    model.robot.joints[1].parameters[0] = -0.5;  // also of a link whose inertia is then no body's
    model.robot.joints[1].parameters.segment<3>(1).setZero();
    set_inertia_tensor(model.robot.joints[1].parameters,
                       Eigen::Vector3d(0.3, 0.1, 0.1).asDiagonal().toDenseMatrix());
  }

  fs::path folder;
  ModelFile model;
};

TEST_F(RobotFile, IsToldByItsContent) {
  write_model(at("model"), model);
  write_file(at("urdf"), "\xEF\xBB\xBF\n " + to_urdf(model.robot).text.substr(22));
  EXPECT_EQ(read_model_file(at("model")).note, "a note");
  EXPECT_EQ(read_model_file(at("model")).coefficients.size(), 1U);
  EXPECT_LT((read_robot(at("urdf")).parameters() - model.robot.parameters()).norm(), 1e-13);
  EXPECT_TRUE(read_model_file(at("urdf")).coefficients.empty());
}

TEST_F(RobotFile, AModelFileHasItsOwnEnds) {
  write_model(at("model"), model);
  EXPECT_EQ(read_robot(at("model"), "base", "tip").size(), 3);
  EXPECT_EQ(error_of([&] { read_robot(at("model"), "", "hand"); }),
            at("model") + ": unknown tip link 'hand': a model file is one chain, and its tip is 'tip'");
  EXPECT_EQ(error_of([&] { read_robot(at("model"), "floor"); }),
            at("model") + ": unknown base link 'floor': a model file is one chain, and its base is 'base'");
}

TEST_F(RobotFile, AnImpossibleLinkIsRefusedOrListed) {
  break_a_link();
  write_model(at("model"), model);
  write_file(at("urdf"), to_urdf(model.robot).text);
  for (const std::string& path : {at("model"), at("urdf")}) {
    EXPECT_EQ(error_of([&] { read_robot(path); }),
              path +
                  ": link 'link2' (joint 2) breaks eq. (11): the mass must be positive [kg]: margin -0.5"
                  " (and 1 more)");
    std::vector<Inconsistency> broken;
    read_robot(path, "", "", Consistency::warn, &broken);
    ASSERT_EQ(broken.size(), 2U);
    EXPECT_EQ(broken[1].link, "link2");
    EXPECT_NEAR(broken[1].margin, -0.05, 1e-15);
    EXPECT_EQ(read_robot(path, "", "", Consistency::ignore, &broken).size(), 3);
    EXPECT_TRUE(broken.empty());
  }
}

TEST_F(RobotFile, ALinkWithoutInertiaPasses) {
  model.robot.joints[1].parameters.setZero();
  write_model(at("model"), model);
  EXPECT_EQ(read_robot(at("model")).size(), 3);
}

}  // namespace
}  // namespace dynid
