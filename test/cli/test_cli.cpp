// SPDX-License-Identifier: Apache-2.0
// The program from outside: exit status, one line of error, nothing half-written.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "../identification/synthetic.hpp"
#include "../model/random_robot.hpp"
#include "../retrieval/problems.hpp"
#include "dynid/base/file.hpp"
#include "dynid/dynamics/dynamics.hpp"
#include "dynid/model/urdf.hpp"
#include "dynid/model/yaml.hpp"
#include "dynid/signal/table.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;

class CommandLine : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / (std::string("dynid_cli_") + info->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  static std::string panda() { return std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml"; }

  /// Runs `dynid arguments`; standard output and error are kept.
  int run(const std::string& arguments) {
    const std::string command =
        launcher_ + DYNID_PROGRAM + " " + arguments + " >" + path("stdout") + " 2>" + path("stderr");
    const int status = std::system(command.c_str());
    out_ = read_file(path("stdout"));
    error_ = read_file(path("stderr"));
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  /// Exit 2, one line on standard error that holds `part`, and no file `out` left behind.
  void expect_refused(const std::string& arguments, const std::string& part) {
    EXPECT_EQ(run(arguments + " --out " + path("out.yaml")), 2) << arguments;
    EXPECT_NE(error_.find(part), std::string::npos) << arguments << "\n" << error_;
    EXPECT_EQ(std::count(error_.begin(), error_.end(), '\n'), 1) << error_;
    EXPECT_FALSE(fs::exists(path("out.yaml"))) << arguments;
    for (const auto& entry : fs::directory_iterator(folder_))
      EXPECT_EQ(entry.path().string().find("out.yaml"), std::string::npos) << entry.path();
  }

  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
    return path(name);
  }

  /// A log of the Panda with linear friction, as CSV.
  std::string log_file(const std::string& name = "log.csv", double duration = 20.0) const {
    const Log log = test::synthetic_log(test::with_linear_friction(test::panda()), 1, duration, 100.0, 0.01);
    std::vector<std::string> names = {"t"};
    for (const char* prefix : {"q", "dq", "tau"})
      for (const std::string& column : column_names(prefix, 7)) names.push_back(column);
    Eigen::MatrixXd values(log.samples(), 22);
    values << log.t, log.q, log.dq, log.tau;
    write_table(path(name), names, values);
    return path(name);
  }

  /// Coefficients of the Panda with noise, which no feasible parameters have.
  std::string coefficients_file() const {
    ModelFile model{test::panda(), {}, ""};
    const BaseParameters base = base_parameters(model.robot);
    Eigen::VectorXd values = base.K * parameter_vector(model.robot, base);
    testing::Generator g(3);
    for (double& value : values) value += 0.02 * testing::normal(g);
    for (int k = 0; k < base.size(); ++k) {
      const auto i = static_cast<std::size_t>(k);
      model.coefficients.push_back({base.names[i], base.expressions[i], values[k], 1.0, true});
    }
    write_model(path("coefficients.yaml"), model);
    return path("coefficients.yaml");
  }

  fs::path folder_;
  std::string out_, error_, launcher_;
};

TEST_F(CommandLine, HelpHasAnExampleForEveryCommand) {
  EXPECT_EQ(run("--help"), 0);
  for (const char* command : {"info", "identify", "reverse", "torque", "retrieve", "excite", "simulate",
                              "diagnose", "blind", "export"}) {
    EXPECT_NE(out_.find(command), std::string::npos);
  }
  for (const char* command : {"info", "identify", "reverse", "torque", "retrieve", "excite", "simulate",
                              "diagnose", "blind", "export"}) {
    EXPECT_EQ(run(std::string(command) + " --help"), 0);
    EXPECT_NE(out_.find("Example: dynid "), std::string::npos) << command;
  }
}

TEST_F(CommandLine, BadUsageIsOneLineAndTwo) {
  for (const char* arguments : {"", "nonsense", "identify", "identify --robot", "info --robot a --model b",
                                "reverse --robot x --samples y --prune -1", "info --robot /no/such.yaml"}) {
    EXPECT_EQ(run(arguments), 2) << arguments;
    EXPECT_EQ(std::count(error_.begin(), error_.end(), '\n'), 1) << error_;
  }
}

// The same log in twelve dialects, under one name: not a byte of the model may depend on how it was written.
TEST_F(CommandLine, TwelveDialectsOfALogGiveOneModel) {
  const Table table = read_table(log_file());
  const std::vector<std::string> usual = table.names;
  struct Dialect {
    const char *separator, *end, *before, *q, *dq, *tau, *t;
    char point = '.';
    bool quoted = false, from_zero = false, reversed = false;
  };
  const std::vector<Dialect> dialects = {
      {",", "\n", "", "q", "dq", "tau", "t"},
      {";", "\n", "", "q", "dq", "tau", "t"},
      {";", "\r\n", "", "q", "dq", "tau", "t", ','},
      {"\t", "\n", "", "q_", "dq_", "tau_", "time"},
      {" ", "\n", "# ", "Q", "DQ", "TAU", "T"},
      {",", "\r\n", "\xEF\xBB\xBF", "position_", "velocity_", "torque_", "timestamp"},
      {",", "\n", "", "q", "qd", "effort", "t", '.', false, true},
      {",", ",\n", "", "q[", "dq[", "tau[", "t", '.', false, true},
      {",", "\n", "", "q", "dq", "tau", "t", ',', true},
      {",", "\n", "sep=,\n", "q", "dq", "tau", "t", '.', false, false, true},
      {" ", "\n", "", "actual_q_", "actual_qd_", "actual_current_as_torque_", "timestamp", '.', false, true},
      {",", "\n", "# recorded at noon\n", "/joint_states/panda_joint#/position",
       "/joint_states/panda_joint#/velocity", "/joint_states/panda_joint#/effort", "__time"},
  };
  std::string first;
  for (std::size_t d = 0; d < dialects.size(); ++d) {
    const Dialect& x = dialects[d];
    const auto field = [&](std::string text) {
      for (char& c : text)
        if (c == '.') c = x.point;
      return x.quoted ? "\"" + text + "\"" : text;
    };
    const auto heading = [&](const std::string& name) {
      if (name == "t") return std::string(x.t);
      const auto digits = name.find_first_of("0123456789");
      const std::string role = name.substr(0, digits);
      const std::string number = std::to_string(std::stoi(name.substr(digits)) - (x.from_zero ? 1 : 0));
      std::string text = role == "q" ? x.q : role == "dq" ? x.dq : x.tau;
      if (const auto at = text.find('#'); at != std::string::npos) return text.replace(at, 1, number);
      return text + number + (text.back() == '[' ? "]" : "");
    };
    std::vector<std::size_t> order(usual.size());
    for (std::size_t k = 0; k < order.size(); ++k) order[k] = x.reversed ? order.size() - 1 - k : k;
    std::string text = x.before;
    for (std::size_t k = 0; k < order.size(); ++k)
      text += (k ? x.separator : "") +
              (x.quoted ? "\"" + heading(usual[order[k]]) + "\"" : heading(usual[order[k]]));
    text += x.end;
    char number[40];
    for (Eigen::Index i = 0; i < table.values.rows(); ++i) {
      for (std::size_t k = 0; k < order.size(); ++k) {
        std::snprintf(number, sizeof number, "%.17g", table.values(i, static_cast<Eigen::Index>(order[k])));
        text += (k ? x.separator : "") + field(number);
      }
      text += x.end;
    }
    write("run.csv", text);
    ASSERT_EQ(run("identify --robot " + panda() + " --log " + path("run.csv") + " --cutoff 10 --out " +
                  path("m.yaml") + " --quiet"),
              0)
        << "dialect " << d << ": " << error_;
    const std::string model = read_file(path("m.yaml"));
    if (d == 0) first = model;
    EXPECT_EQ(model, first) << "dialect " << d;
  }
  EXPECT_EQ(dialects.size(), 12u);
}

// What people have: a model whose damping is a simulator's placeholder, and a log with another sign or other
// zeros.
TEST_F(CommandLine, ATurnedLogAndAPlaceholderDampingAreBothNamed) {
  Robot plant = test::panda();
  for (Joint& joint : plant.joints) joint.friction = {};
  Robot model = plant;
  for (Joint& joint : model.joints) joint.friction.linear.viscous = 1.0;
  write_model(path("plant.yaml"), {plant, {}, ""});
  write_model(path("model.yaml"), {model, {}, ""});
  ASSERT_EQ(run("simulate --model " + path("plant.yaml") +
                " --excite --duration 12 --rate 200 --seed 41 --spread 0.01 " + "--out " + path("right.csv")),
            0)
      << error_;
  const Table right = read_table(path("right.csv"));
  Table turned = right, moved = right;
  for (std::size_t k = 0; k < right.names.size(); ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    if (right.names[k].rfind("tau", 0) == 0) turned.values.col(column) *= -1.0;
    if (right.names[k] == "q2") moved.values.col(column).array() -= 1.570796327;
    if (right.names[k] == "q4") moved.values.col(column).array() += 1.570796327;
  }
  write_table(path("turned.csv"), turned.names, turned.values);
  write_table(path("moved.csv"), moved.names, moved.values);
  const std::pair<const char*, const char*> cases[] = {
      {"turned.csv", "torque_sign=-1"}, {"moved.csv", "joint_zero=0,1.570796327,0,-1.570796327,0,0,0"}};
  for (const auto& [log, assume] : cases) {
    const std::string command =
        "diagnose --model " + path("model.yaml") + " --log " + path(log) + " --json " + path("d.json");
    EXPECT_EQ(run(command), 1) << "misread";
    EXPECT_NE(out_.find("--assume " + std::string(assume)), std::string::npos) << out_;
    EXPECT_NE(error_.find("damping is 1 on every joint: a placeholder"), std::string::npos) << error_;
    EXPECT_EQ(nlohmann::json::parse(read_file(path("d.json")))["verdict"], "misread");
    ASSERT_EQ(run(command + " --assume auto"), 0) << error_;
    const auto json = nlohmann::json::parse(read_file(path("d.json")));
    ASSERT_FALSE(json["effects"].empty()) << out_;
    EXPECT_EQ(json["effects"][0]["name"], "viscous_friction") << out_;
    for (const double x : json["effects"][0]["parameters"]["coefficient"]["value"]) EXPECT_NEAR(x, -1.0, 0.1);
    ASSERT_EQ(run("identify --robot " + path("model.yaml") + " --log " + path(log)), 0) << error_;
    EXPECT_NE(out_.find("give --assume " + std::string(assume)), std::string::npos) << out_;
  }
}

TEST_F(CommandLine, IdentifyWritesAModelThatTorquePredictsWith) {
  const std::string log = log_file();
  ASSERT_EQ(run("identify --robot " + panda() + " --log " + log + " --cutoff 10 --out " + path("m.yaml") +
                " --json " + path("i.json")),
            0)
      << error_;
  EXPECT_NE(out_.find("Identified 64 coefficients"), std::string::npos) << out_;
  const auto json = nlohmann::json::parse(read_file(path("i.json")));
  EXPECT_EQ(json["rank"], 64);
  EXPECT_EQ(json["rmse"].size(), 7u);
  EXPECT_EQ(json["validation"]["rmse"].size(), 7u);
  EXPECT_EQ(json["coefficients"].size(), 64u);
  EXPECT_EQ(json["coefficients"][0]["name"], "zz1");
  EXPECT_EQ(json["coefficients"][0]["expression"], "yy2 + zz1");
  EXPECT_TRUE(json["data"]["issues"].is_array());

  ASSERT_EQ(run("torque --quiet --model " + path("m.yaml") + " --log " + log + " --out " + path("t.csv")), 0)
      << error_;
  EXPECT_EQ(out_, "");
  const Table predicted = read_table(path("t.csv")), measured = read_table(log);
  ASSERT_EQ(predicted.values.rows(), measured.values.rows());
  EXPECT_EQ(predicted.names.front(), "t");
  const Eigen::MatrixXd e = predicted.group("tau", 7, true) - measured.group("tau", 7, true);
  EXPECT_LT(std::sqrt(e.middleRows(200, 1500).squaredNorm() / (1500.0 * 7.0)), 0.1);
}

TEST_F(CommandLine, RetrieveMakesAFeasibleModelOfCoefficients) {
  const std::string bounds = std::string(DYNID_SOURCE_DIR) + "/config/panda_bounds.yaml";
  ASSERT_EQ(run("identify --quiet --robot " + panda() + " --log " + log_file() + " --cutoff 10 --out " +
                path("m.yaml")),
            0);
  const std::string command = "retrieve --model " + path("m.yaml") + " --runs 2 --steps 3 --bounds ";
  ASSERT_EQ(run(command + bounds + " --out " + path("f.yaml") + " --json " + path("f.json")), 0) << error_;
  const auto json = nlohmann::json::parse(read_file(path("f.json")));
  EXPECT_TRUE(json["feasible"]);
  EXPECT_EQ(json["links"].size(), 7u);
  EXPECT_EQ(json["runs"].size(), 2u);
  for (const auto& constraint : json["constraints"])
    EXPECT_GE(constraint["margin"], 0.0) << constraint["name"];
  EXPECT_TRUE(inconsistencies(read_model(path("f.yaml")).robot, 0.0).empty());

  std::string text = read_file(bounds);
  const std::size_t total = text.find("total_mass: [");
  text.replace(total, text.find(']', total) - total + 1,
               "total_mass: [90, 95]");  // seven links of 10 kg at most
  expect_refused(command + write("heavy.yaml", text), "heavy.yaml");
  expect_refused("retrieve --model " + panda() + " --bounds " + bounds, "zz1 is missing");
}

// The two-link example of the supplementary material, Section V, from outside: shapes as expressions and as
// solids, the same with box constraints only, whose report names the shape that is violated.
TEST_F(CommandLine, RetrieveKeepsTheTwoLinksInTheirShapes) {
  std::vector<LinkInertia> bodies = testing::two_link_truth();
  const auto model_of = [&](const std::string& name) {
    ModelFile model{testing::two_link_robot(bodies), {}, ""};
    const BaseParameters base = base_parameters(model.robot);
    EXPECT_EQ(base.size(), 8);
    const Eigen::VectorXd values = base.K * parameter_vector(model.robot, base);
    for (int k = 0; k < base.size(); ++k) {
      const auto i = static_cast<std::size_t>(k);
      model.coefficients.push_back({base.names[i], base.expressions[i], values[k], 1.0, true});
    }
    for (Joint& joint : model.robot.joints) joint.parameters.setZero();
    write_model(path(name), model);
    return path(name);
  };
  // In the frames of the model: link 1 along z from its origin, link 2 along x.
  const std::string boxes =
      "format: dynid-bounds-1\ntotal_mass: [1, 15]\nlinks:\n"
      "  - {mass: [0, 10], com_x: [-0.15, 0.15], com_y: [-0.15, 0.15], com_z: [0.08, 1.58], "
      "inertia_diagonal: [0, 1], inertia_off_diagonal: [-1, 1]}\n"
      "  - {mass: [MASS], com_x: [0, 0.8], com_y: [-0.08, 0.08], com_z: [-0.08, 0.08], "
      "inertia_diagonal: [0, 1], inertia_off_diagonal: [-1, 1]}\n";
  const auto bounds_of = [&](const std::string& shapes, const std::string& mass) {
    return write("b.yaml", test::replaced(boxes, "MASS", mass) + shapes);
  };
  const auto solids = [](const std::string& enforce) {
    return "shapes:\n  - {link: 1, name: cylinder, enforce: " + enforce +
           ", solids: [{type: cylinder, from: [0, 0, 0], to: [0, 0, 1.5], radius: 0.15}]}\n"
           "  - {link: 2, name: cone, enforce: " +
           enforce +
           ", solids: [{type: cylinder, from: [0, 0, 0], to: [0.6, 0, 0], radius: 0.08},\n"
           "             {type: truncated_cone, from: [0.6, 0, 0], to: [0.8, 0, 0], radius_from: 0.08, "
           "radius_to: 0.02}]}\n";
  };
  const std::string expressions =
      "constraints:\n  - {name: cylinder, expression: 0.15 - sqrt(c1x^2 + c1y^2)}\n"
      "  - {name: cone, expression: '(c2x >= 0.6 ? 0.08 - 0.3*(c2x - 0.6) : 0.08) - sqrt(c2y^2 + c2z^2)'}\n";
  nlohmann::json report;
  const auto retrieve = [&](const std::string& model, const std::string& bounds) {
    ASSERT_EQ(run("retrieve --model " + model + " --bounds " + bounds + " --runs 2 --steps 5 --out " +
                  path("found.yaml") + " --json " + path("r.json")),
              0)
        << error_;
    report = nlohmann::json::parse(read_file(path("r.json")));
  };
  const auto margin = [&](const std::string& name) {
    for (const auto& constraint : report["constraints"])
      if (constraint["name"] == name) return constraint["margin"].get<double>();
    ADD_FAILURE() << name << " is not reported";
    return 0.0;
  };
  const Robot truth = testing::two_link_robot(bodies);
  const std::string model = model_of("m.yaml");
  for (const std::string& shapes : {expressions, solids("true")}) {
    retrieve(model, bounds_of(shapes, "0, 5"));
    EXPECT_LE(report["objective"], 1e-10);
    EXPECT_GE(margin("cylinder"), 0.0);
    EXPECT_GE(margin("cone"), 0.0);
    const Model<2> found(read_model(path("found.yaml")).robot), real(truth);
    Workspace<2> ws(real);
    for (int k = 0; k < 100; ++k) {
      const Eigen::Vector2d q(0.3 * k, -0.7 * k), dq(std::sin(k), std::cos(k)),
          ddq(3.0 * dq[1], -2.0 * dq[0]);
      Eigen::Vector2d a, b;
      inverse_dynamics(found, ws, q, dq, ddq, a);
      inverse_dynamics(real, ws, q, dq, ddq, b);
      EXPECT_LE((a - b).cwiseAbs().maxCoeff(), 1e-6) << shapes;
    }
  }
  // A centre of mass within its box, beyond the cone, at a mass that is known.
  bodies[1].com = {-0.02, 0.06, 0.06};
  const std::string beyond = model_of("beyond.yaml");
  retrieve(beyond, bounds_of(solids("false"), "2.9, 3.1"));
  EXPECT_LE(report["objective"], 1e-10);
  EXPECT_LT(margin("cone"), -0.01);
  EXPECT_NE(out_.find("violated: cone"), std::string::npos) << out_;
  retrieve(beyond, bounds_of(solids("true"), "2.9, 3.1"));
  EXPECT_GT(report["objective"], 1e-6);
  EXPECT_GE(margin("cone"), 0.0);
}

// Law: threads, and processes where built with MPI, do not change a byte of the model.
TEST_F(CommandLine, RetrieveIsTheSameHoweverItIsShared) {
  const std::string reversed = coefficients_file();
  const std::string bounds = std::string(DYNID_SOURCE_DIR) + "/config/panda_bounds.yaml";
  const std::string command = "retrieve --model " + reversed + " --bounds " + bounds +
                              " --runs 4 --steps 3 --seed 5 --out " + path("out.yaml") + " --json " +
                              path("out.json") + " --threads ";
  const auto runs = [&] {
    std::vector<std::pair<double, double>> list;
    const auto json = nlohmann::json::parse(read_file(path("out.json")));
    for (const auto& entry : json["runs"]) list.emplace_back(entry["seed"], entry["objective"]);
    return list;
  };
  ASSERT_EQ(run(command + "1"), 0) << error_;
  const std::string model = read_file(path("out.yaml"));
  const auto one = runs();
  EXPECT_EQ(one.size(), 4u);
  ASSERT_EQ(run(command + "2"), 0) << error_;
  EXPECT_EQ(read_file(path("out.yaml")), model);
  EXPECT_EQ(runs(), one);
#ifdef DYNID_MPIEXEC
  launcher_ =
      "OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 "
      "OMPI_MCA_rmaps_base_oversubscribe=1 " DYNID_MPIEXEC " -n 4 ";
  ASSERT_EQ(run(command + "1"), 0) << error_;
  EXPECT_EQ(read_file(path("out.yaml")), model);
  EXPECT_EQ(runs(), one);
#endif
}

// A prior picks among equals, and the report says at what price.
TEST_F(CommandLine, RetrieveStaysCloseToAPriorAndReportsThePrice) {
  const std::string reversed = coefficients_file();
  const std::string command = "retrieve --model " + reversed + " --bounds " + DYNID_SOURCE_DIR +
                              "/config/panda_bounds.yaml --runs 1 --steps 3 --json " + path("r.json") +
                              " --out ";
  ASSERT_EQ(run(command + path("without.yaml")), 0) << error_;
  const double without = nlohmann::json::parse(read_file(path("r.json")))["objective"];
  EXPECT_TRUE(nlohmann::json::parse(read_file(path("r.json")))["trade_off"].empty());
  ASSERT_EQ(run(command + path("with.yaml") + " --prior " + panda()), 0) << error_;
  const auto json = nlohmann::json::parse(read_file(path("r.json")));
  EXPECT_TRUE(json["feasible"]);
  EXPECT_LE(json["objective"], 1.0011 * without);
  const auto& trade_off = json["trade_off"];
  ASSERT_GE(trade_off.size(), 4u);
  EXPECT_EQ(trade_off[0]["weight"], 0.0);
  for (std::size_t k = 2; k < trade_off.size(); ++k) {
    EXPECT_GT(trade_off[k]["weight"], trade_off[k - 1]["weight"]);
    EXPECT_LE(trade_off[k]["distance"].get<double>(), 1.001 * trade_off[k - 1]["distance"].get<double>());
    EXPECT_GE(trade_off[k]["objective"].get<double>(), 0.999 * trade_off[k - 1]["objective"].get<double>());
  }
  const Eigen::VectorXd prior = test::panda().parameters();
  EXPECT_LT((read_model(path("with.yaml")).robot.parameters() - prior).norm(),
            (read_model(path("without.yaml")).robot.parameters() - prior).norm());
  EXPECT_EQ(run(command + path("x.yaml") + " --prior /no/such.urdf"), 2);
}

// Fitted over all rows, a spring of another joint would push, and rest where that joint never comes.
TEST_F(CommandLine, DemoNamesNoJointWhereTheEffectIsImpossible) {
  ASSERT_EQ(run("demo --robot " + panda() + " --bounds " + std::string(DYNID_SOURCE_DIR) +
                "/config/panda_bounds.yaml --seed 2 --out " + path("demo2") + " --json " + path("d2.json")),
            0)
      << error_;
  const auto json = nlohmann::json::parse(read_file(path("d2.json")));
  ASSERT_EQ(json["diagnosis"]["effects"].size(), 1u);
  EXPECT_EQ(json["diagnosis"]["effects"][0]["joints"], nlohmann::json::array({2}));
}

TEST_F(CommandLine, DemoTellsTheWholeStory) {
  const std::string bounds = std::string(DYNID_SOURCE_DIR) + "/config/panda_bounds.yaml";
  ASSERT_EQ(run("demo --robot " + panda() + " --bounds " + bounds + " --out " + path("demo") + " --json " +
                path("d.json")),
            0)
      << error_;
  const auto json = nlohmann::json::parse(read_file(path("d.json")));
  EXPECT_EQ(json["rank"], 78);  // 43 of the rigid body (Section III) and five a joint of friction, eq. (25)
  EXPECT_LT(json["relative_error_percent"], 0.5);
  EXPECT_EQ(json["feasible"], true);
  ASSERT_EQ(json["hidden"].size(), 1u);
  EXPECT_EQ(json["hidden"][0]["name"], "joint_spring");
  const auto& diagnosis = json["diagnosis"];
  EXPECT_EQ(diagnosis["verdict"], "explained");
  ASSERT_GE(diagnosis["effects"].size(), 1u);
  EXPECT_EQ(diagnosis["effects"][0]["name"], "joint_spring");
  EXPECT_EQ(diagnosis["effects"][0]["joints"], nlohmann::json::array({2}));
  EXPECT_NEAR(diagnosis["effects"][0]["parameters"]["stiffness"]["value"][1].get<double>(), 20.0, 0.5);
  // One screen.
  EXPECT_LT(std::count(out_.begin(), out_.end(), '\n'), 24) << out_;
  for (const char* part :
       {"1 excite", "2 identify", "3 feasible", "4 hide", "5 diagnose", "explains the gap", "Report: "})
    EXPECT_NE(out_.find(part), std::string::npos) << part << ": " << out_;
  // One page, in this order.
  const std::string report = read_file(path("demo/report.html"));
  std::size_t at = 0;
  for (const char* part : {"explains the gap", "id=\"where\"", "id=\"hidden\"", "id=\"residual\"",
                           "id=\"replay\"", "id=\"patch\"", "velocity_lag", "jitter", "repeated_rows",
                           "Coefficients", "Made feasible", "</html>"}) {
    const std::size_t next = report.find(part, at);
    ASSERT_NE(next, std::string::npos) << part;
    at = std::string(part).find("id=") == 0 ? next : at;
  }
  EXPECT_EQ(report.find(" src="), std::string::npos) << "the report needs no network";
  EXPECT_EQ(read_model(path("demo/identified.yaml")).coefficients.size(), 78u);
  EXPECT_TRUE(inconsistencies(read_model(path("demo/feasible.yaml")).robot).empty());
  const Robot patched = read_model(path("demo/patched.yaml")).robot;
  ASSERT_EQ(patched.effects.size(), 1u);
  EXPECT_EQ(patched.effects[0].name, "joint_spring");
  EXPECT_NEAR(patched.effects[0].parameters.at("stiffness").at(1), 20.0, 0.5);

  EXPECT_EQ(run("demo --robot " + panda() + " --bounds " + bounds + " --effect no_such --out " + path("x")),
            2);
  EXPECT_NE(error_.find("no_such"), std::string::npos) << error_;
}

TEST_F(CommandLine, JsonOnStandardOutputIsAloneThere) {
  ASSERT_EQ(run("info --robot " + panda() + " --json -"), 0);
  const auto json = nlohmann::json::parse(out_);
  EXPECT_EQ(json["rank"], 43);
  EXPECT_EQ(json["joints"].size(), 7u);
  EXPECT_EQ(json["standard_parameters"].size(), 70u);
}

TEST_F(CommandLine, ExportedUrdfIsTheSameRobot) {
  ASSERT_EQ(run("export --model " + panda() + " --format urdf --out " + path("p.urdf")), 0) << error_;
  EXPECT_NE(out_.find("not expressed"), std::string::npos) << "eq. (25) has no place in a URDF: " << out_;
  const Robot urdf = read_urdf(path("p.urdf"));
  EXPECT_LT((urdf.parameters() - test::panda().parameters()).cwiseAbs().maxCoeff(), 1e-12);
  ASSERT_EQ(run("export --model " + panda() + " --format yaml --out " + path("p.yaml")), 0) << error_;
  EXPECT_LT(
      (read_model(path("p.yaml")).robot.parameters() - test::panda().parameters()).cwiseAbs().maxCoeff(),
      1e-14);
}

TEST_F(CommandLine, ExportKnowsOtherPrograms) {
  for (const auto& [format, words] :
       {std::pair{"mjcf", "<mujoco model=\"panda\">"}, std::pair{"sdf", "<sdf version="},
        std::pair{"franka", "link7:\n"}, std::pair{"header", "namespace panda_model {"}}) {
    ASSERT_EQ(run(std::string("export --model ") + panda() + " --format " + format + " --out " +
                  path("export.txt") + " --json " + path("export.json")),
              0)
        << error_;
    EXPECT_NE(read_file(path("export.txt")).find(words), std::string::npos) << format;
    const auto json = nlohmann::json::parse(read_file(path("export.json")));
    EXPECT_EQ(json["not_expressed"].empty(), std::string(format) == "header") << format;
  }
  EXPECT_EQ(run("export --model " + panda() + " --format mjcf --into a.urdf --out " + path("x")), 2);
  EXPECT_NE(error_.find("--into goes with --format urdf"), std::string::npos) << error_;
}

TEST_F(CommandLine, BadLogsAreRefusedByFileLineAndColumn) {
  const std::string good = read_file(log_file());
  const std::string identify = "identify --robot " + panda() + " --log ";
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    return text;
  };
  std::istringstream lines(good);
  std::string header, first, second, third;
  for (std::string* line : {&header, &first, &second, &third}) std::getline(lines, *line);

  expect_refused(identify + write("column.csv", replaced("tau3", "other")),
                 "column.csv: column tau3 is missing");
  expect_refused(
      identify + write("text.csv", header + "\n" + first + "\nabc" + second.substr(second.find(','))),
      "text.csv:3: column t: 'abc' is not a number");
  expect_refused(identify + write("nan.csv", header + "\n" + first.substr(0, first.rfind(',')) + ",nan\n"),
                 "nan.csv:2: column tau7 has no number");
  expect_refused(identify + write("back.csv", header + "\n" + second + "\n" + first + "\n"),
                 "back.csv:3: column t: time goes back");
  expect_refused(identify + write("empty.csv", ""), "empty.csv: the file is empty");
  expect_refused(identify + write("cut.csv", good.substr(0, good.size() - 40)), "the row has");
  expect_refused(identify + path("absent.csv"), "absent.csv: cannot be read");
  expect_refused(
      identify + write("six.csv",
                       "t,q1,q2,q3,q4,q5,q6,dq1,dq2,dq3,dq4,dq5,dq6,tau1,tau2,tau3,tau4,tau5,tau6\n"
                       "0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n"),
      "the log has 6 joints (q1..q6), the robot has 7");
}

TEST_F(CommandLine, AMotionThatExcitesNothingSaysWhichCoefficients) {
  std::string text = "t";
  for (const char* prefix : {"q", "dq", "tau"})
    for (const std::string& column : column_names(prefix, 7)) text += "," + column;
  text += "\n";
  for (int i = 0; i < 2000; ++i) {
    text += std::to_string(0.01 * i);
    for (int k = 0; k < 14; ++k) text += ",0.25";
    for (int k = 0; k < 7; ++k) text += "," + std::to_string(k + 0.001 * (i % 7));
    text += "\n";
  }
  expect_refused("identify --robot " + panda() + " --log " + write("still.csv", text), "does not excite zz1");
}

TEST_F(CommandLine, BadRobotsAreRefusedByLinkAndRule) {
  const std::string log = " --log " + log_file("log.csv", 2.0);
  std::string negative = read_file(panda());
  const std::size_t mass = negative.find("mass: ", negative.find("panda_link3"));
  negative.insert(mass + 6, "-");
  expect_refused("identify --robot " + write("negative.yaml", negative) + log, "panda_link3");
  const std::string joint =
      R"(<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>)";
  const std::string back =
      R"(<joint name="k" type="revolute"><parent link="b"/><child link="a"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>)";
  expect_refused("identify --robot " +
                     write("loop.urdf", R"(<robot name="r"><link name="a"/><link name="b"/>)" + joint + back +
                                            "</robot>") +
                     log,
                 "loop.urdf");
  expect_refused(
      "identify --tip nowhere --robot " +
          write("tip.urdf", R"(<robot name="r"><link name="a"/><link name="b"/>)" + joint + "</robot>") + log,
      "nowhere");
}

TEST_F(CommandLine, OutputThatCannotBeWrittenIsFoundBeforeTheWork) {
  EXPECT_EQ(run("identify --robot " + panda() + " --log " + log_file() + " --out /no/such/folder/m.yaml"), 2);
  EXPECT_NE(error_.find("/no/such/folder"), std::string::npos) << error_;
  EXPECT_EQ(std::count(error_.begin(), error_.end(), '\n'), 1) << error_;
  EXPECT_EQ(run("info --robot " + panda() + " --json /no/such/folder/m.json"), 2);
}

TEST_F(CommandLine, AFailedRunLeavesTheOldFileAlone) {
  write("out.yaml", "old");
  EXPECT_EQ(
      run("identify --robot " + panda() + " --log " + write("empty.csv", "") + " --out " + path("out.yaml")),
      2);
  EXPECT_EQ(read_file(path("out.yaml")), "old");
}

}  // namespace
}  // namespace dynid
