// SPDX-License-Identifier: Apache-2.0
//
// A subcommand that the program does not have, written here alone as one is written, beside all the others.
#include <gtest/gtest.h>

#include <iostream>
#include <memory>
#include <sstream>

#include "cli/command.hpp"
#include "cli/commands.hpp"
#include "dynid/app/info.hpp"
#include "dynid/base/error.hpp"

namespace dynid {
namespace {

/// `dynid reach`: the sum of the distances between a robot's joints.
struct Arguments {
  Output output;
  RobotOption robot;
};

void run_reach(const Arguments& a) {
  a.output.check();
  const Robot robot = a.robot.read(a.output).robot;
  double reach = 0.0;
  for (std::size_t k = 1; k < robot.joints.size(); ++k) reach += robot.joints[k].origin.translation().norm();
  a.output.write({{"reach", reach}});
  if (a.output.summary()) std::cout << robot.name << " reaches " << reach << " m\n";
}

void add_reach(CLI::App& app, int& status) {
  auto a = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("reach", "How far a robot reaches");
  a->robot.add_to(*command, "--robot", true);
  a->output.add_to(*command);
  command->callback([a, &status] {
    run_reach(*a);
    status = 0;
  });
}

TEST(NewSubcommand, StandsBesideTheOthers) {
  CLI::App app{"dynid", "dynid"};
  app.require_subcommand(1);
  int status = -1;
  add_commands(app, status);
  add_reach(app, status);
  EXPECT_NE(app.help().find("reach"), std::string::npos);
  testing::internal::CaptureStdout();
  app.parse("reach --robot " DYNID_SOURCE_DIR "/config/panda.yaml");
  const std::string said = testing::internal::GetCapturedStdout();
  EXPECT_EQ(status, 0);
  EXPECT_EQ(said.rfind("panda reaches ", 0), 0U) << said;
}

TEST(NewSubcommand, HasTheOptionsAndRefusalsOfAll) {
  CLI::App app{"dynid", "dynid"};
  int status = -1;
  add_reach(app, status);
  EXPECT_THROW(app.parse("reach --robot /nowhere.yaml"), Error);
  EXPECT_EQ(status, -1);
}

}  // namespace
}  // namespace dynid
