// SPDX-License-Identifier: Apache-2.0
// The parameters of identification_node, read and checked, and what it makes of a log; no roscore needed.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <functional>
#include <regex>
#include <sstream>

#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "identification/synthetic.hpp"
#include "ros/identification_run.hpp"
#include "ros/identification_settings.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;
using Texts = std::map<std::string, std::string>;

IdentificationSettings read(const Texts& texts) {
  std::vector<std::string> unknown;
  const IdentificationSettings settings = identification_settings(texts, unknown);
  EXPECT_TRUE(unknown.empty()) << unknown.front();
  return settings;
}

TEST(IdentificationSettings, AreTheProgramsWhereNothingIsSet) {
  const IdentificationSettings s = read({});
  EXPECT_EQ(s.folder, "identification");
  EXPECT_EQ(s.job.identify.options.friction, FrictionLaw::linear);
  EXPECT_EQ(s.job.identify.options.prune_percent, 30.0);
  EXPECT_FALSE(s.job.retrieve.has_value());
  ASSERT_TRUE(s.job.diagnose.has_value());
  EXPECT_EQ(s.job.diagnose->options.tolerance, DiagnoseOptions().tolerance);
  EXPECT_EQ(s.excite.options.starts, ExciteOptions().starts);
}

TEST(IdentificationSettings, SayHowALogIsToBeRead) {
  for (const char* gravity : {"[0, 0, -9.81]", "0,0,-9.81", "[0,0,-9.81]"}) {
    const IdentificationSettings s = read({{"assume", "torque_sign=-1"},
                                           {"gravity", gravity},
                                           {"columns", "q=pos_#,tau=trq_#"},
                                           {"log_rate", "250"}});
    EXPECT_EQ(s.job.identify.assume, "torque_sign=-1");
    EXPECT_EQ(s.job.diagnose->assume, "torque_sign=-1");
    ASSERT_TRUE(s.gravity.has_value()) << gravity;
    EXPECT_EQ(*s.gravity, Eigen::Vector3d(0, 0, -9.81));
    EXPECT_EQ(s.columns, "q=pos_#,tau=trq_#");
    EXPECT_EQ(s.log_rate, 250.0);
  }
  for (const char* gravity : {"[0,0]", "down", "[0,0,-9.81", "0,0,-9.81,"})
    EXPECT_THROW(read({{"gravity", gravity}}), Error) << gravity;
  EXPECT_THROW(read({{"columns", "pos"}}), Error);
}

/// Every parameter of docs/nodes.md, at a value that is not its default.
TEST(IdentificationSettings, TakeEveryParameterOfTheirs) {
  const IdentificationSettings s = read({{"model", "m.yaml"},
                                         {"base", "b"},
                                         {"tip", "t"},
                                         {"output_directory", "o"},
                                         {"topic", "/x"},
                                         {"cutoff", "10"},
                                         {"friction", "Sigmoid"},
                                         {"rotor_inertia", "true"},
                                         {"method", "irls"},
                                         {"motion", "position"},
                                         {"prune", "20.5"},
                                         {"validate", "v.csv"},
                                         {"allow_inconsistent", "1"},
                                         {"bounds", "b.yaml"},
                                         {"runs", "7"},
                                         {"steps", "8"},
                                         {"agree", "3"},
                                         {"weighted", "true"},
                                         {"prior", "p.urdf"},
                                         {"reference", "r.bag"},
                                         {"tolerance", "0.05"},
                                         {"withhold", "payload"},
                                         {"diagnose", "true"},
                                         {"harmonics", "4"},
                                         {"period", "15"},
                                         {"base_period", "5"},
                                         {"rate", "500"},
                                         {"kind", "ramped"},
                                         {"ramp", "2"},
                                         {"criterion", "determinant"},
                                         {"collision", "none"},
                                         {"margin", "0.1"},
                                         {"starts", "3"},
                                         {"effort", "50"},
                                         {"seed", "11"},
                                         {"threads", "2"}});
  EXPECT_EQ(s.model + s.base + s.tip + s.folder + s.topic, "m.yamlbto/x");
  const IdentifyOptions& i = s.job.identify.options;
  EXPECT_EQ(i.prepare.cutoff, 10.0);
  EXPECT_EQ(i.friction, FrictionLaw::sigmoid);
  EXPECT_TRUE(i.rotor_inertia);
  EXPECT_EQ(i.method, Method::irls);
  EXPECT_EQ(i.prepare.source, MotionSource::position);
  EXPECT_EQ(i.prune_percent, 20.5);
  EXPECT_EQ(s.validation + s.bounds + s.prior + s.reference + s.collision, "v.csvb.yamlp.urdfr.bagnone");
  EXPECT_TRUE(s.allow_inconsistent);
  ASSERT_TRUE(s.job.retrieve.has_value());
  const RetrievalOptions& r = s.job.retrieve->options;
  EXPECT_EQ(r.runs, 7);
  EXPECT_EQ(r.steps, 8);
  EXPECT_EQ(r.agreeing_runs, 3);
  EXPECT_EQ(r.seed, 11u);
  EXPECT_EQ(r.threads, 2);
  EXPECT_TRUE(s.job.retrieve->weighted);
  ASSERT_TRUE(s.job.diagnose.has_value());
  EXPECT_EQ(s.job.diagnose->options.tolerance, 0.05);
  EXPECT_EQ(s.job.diagnose->options.seed, 11u);
  EXPECT_EQ(s.job.diagnose->withhold, std::vector<std::string>{"payload"});
  const ExciteOptions& e = s.excite.options;
  EXPECT_EQ(e.harmonics, 4);
  EXPECT_EQ(e.duration, 15.0);
  EXPECT_EQ(e.base_period, 5.0);
  EXPECT_EQ(s.excite.rate, 500.0);
  EXPECT_EQ(e.kind, MotionKind::ramped);
  EXPECT_EQ(e.ramp, 2.0);
  EXPECT_EQ(e.criterion, ExcitationCriterion::determinant);
  EXPECT_EQ(e.margin, 0.1);
  EXPECT_EQ(e.starts, 3);
  EXPECT_EQ(e.effort, 50);
  EXPECT_EQ(e.seed, 11u);
  EXPECT_EQ(e.threads, 2);
  EXPECT_TRUE(e.regressor.rotor_inertia);
  EXPECT_FALSE(read({{"diagnose", "false"}}).job.diagnose.has_value());
}

/// Law: what is out of range, or not of its type, is named in one line; what is not known is listed.
TEST(IdentificationSettings, NameWhatIsWrong) {
  for (const auto& [name, value, complaint] :
       {std::tuple{"cutoff", "-1", "~cutoff: -1 is negative"},
        std::tuple{"cutoff", "ten", "~cutoff: ten is not a number"},
        std::tuple{"friction", "wet", "~friction: wet is none of linear, none, sigmoid"},
        std::tuple{"rotor_inertia", "yes", "~rotor_inertia: yes is not true or false"},
        std::tuple{"prune", "-1", "~prune: -1 is negative"},
        std::tuple{"runs", "2.5", "~runs: 2.5 is not a whole number"},
        std::tuple{"steps", "0", "~steps: 0 is not positive"},
        std::tuple{"agree", "-1", "~agree: -1 is negative"},
        std::tuple{"seed", "-1", "~seed: -1 is not a whole number from 0"},
        std::tuple{"threads", "-1", "~threads: -1 is negative"},
        std::tuple{"tolerance", "-0.1", "~tolerance: -0.1 is negative"},
        std::tuple{"withhold", "luck", "~withhold: luck is not friction, payload or the name of an effect"},
        std::tuple{"harmonics", "51", "~harmonics: 51 is not within 1..50"},
        std::tuple{"period", "0", "~period: 0 is not positive"},
        std::tuple{"margin", "0.6", "~margin: 0.6 is not within"},
        std::tuple{"effort", "1", "~effort: 1 is not within"},
        std::tuple{"kind", "square", "~kind: square is none of"}}) {
    try {
      std::vector<std::string> unknown;
      identification_settings({{"bounds", "b.yaml"}, {name, value}}, unknown);
      ADD_FAILURE() << name << " " << value;
    } catch (const Error& error) {
      EXPECT_EQ(std::string(error.what()).rfind(complaint, 0), 0u) << error.what();
    }
  }
  std::vector<std::string> unknown;
  identification_settings({{"cutof", "10"}, {"cutoff", "10"}}, unknown);
  EXPECT_EQ(unknown, std::vector<std::string>{"cutof"});
}

/// Without what differs from run to run.
nlohmann::json plain(nlohmann::json value) {
  const std::function<void(nlohmann::json&)> clean = [&](nlohmann::json& v) {
    if (v.is_object()) v.erase("seconds");
    if (v.is_structured())
      for (nlohmann::json& inner : v) clean(inner);
  };
  clean(value);
  return value;
}

/// Law: the files are the program's, to the last byte but for the time taken.
TEST(IdentificationRun, WritesWhatTheProgramWrites) {
  const fs::path folder = fs::path(::testing::TempDir()) / "dynid_identification_run";
  fs::remove_all(folder);
  fs::create_directories(folder);
  const auto path = [&](const std::string& name) { return (folder / name).string(); };
  const auto json = [&](const std::string& name) { return nlohmann::json::parse(read_file(path(name))); };
  const std::string panda = std::string(DYNID_SOURCE_DIR) + "/config/panda.yaml";
  const std::string bounds = std::string(DYNID_SOURCE_DIR) + "/config/panda_bounds.yaml";
  Robot truth = test::panda();
  truth.joints[3].friction.linear.viscous += 2.0;
  write_log(path("log.csv"), test::synthetic_log(truth, 3, 12.0, 100.0, 0.02));

  const IdentificationSettings s = read({{"model", panda},
                                         {"output_directory", path("out")},
                                         {"cutoff", "10"},
                                         {"bounds", bounds},
                                         {"runs", "1"},
                                         {"steps", "2"}});
  std::ostringstream summary;
  double last = 0.0;
  Context context;
  context.progress = [&](const std::string&, double fraction) {
    EXPECT_GE(fraction, last);
    last = fraction;
  };
  const nlohmann::json result = identify_log(s, path("log.csv"), context, &summary);
  EXPECT_EQ(result["status"], 0);
  EXPECT_GT(last, 0.9);
  for (const auto& [what, file] : result["files"].items())
    EXPECT_TRUE(fs::exists(file.get<std::string>())) << what;
  EXPECT_EQ(result["files"].size(), 7u);
  EXPECT_EQ(result, json("out/result.json"));
  EXPECT_EQ(result["adoptable"], path("out/feasible.yaml"));

  const auto run = [&](const std::string& arguments) {
    EXPECT_EQ(std::system((std::string(DYNID_PROGRAM) + " " + arguments + " >>" + path("stdout")).c_str()),
              0);
  };
  fs::copy(folder / "out", folder / "kept", fs::copy_options::recursive);
  run("identify --cutoff 10 --robot " + panda + " --log " + path("log.csv") + " --out " +
      path("out/identified.yaml") + " --json " + path("out/identification.json"));
  run("retrieve --runs 1 --steps 2 --model " + path("out/identified.yaml") + " --bounds " + bounds +
      " --out " + path("out/feasible.yaml") + " --json " + path("out/retrieval.json"));
  run("diagnose --model " + panda + " --log " + path("log.csv") + " --patch " + path("out/patched.yaml") +
      " --report " + path("out/report.html") + " --json " + path("out/diagnosis.json"));
  const auto page = [&](const std::string& name) {
    return std::regex_replace(read_file(path(name)), std::regex("[0-9.]+ s of computing"), "");
  };
  for (const std::string file : {"identified.yaml", "feasible.yaml", "patched.yaml", "report.html"})
    EXPECT_TRUE(page("kept/" + file) == page("out/" + file)) << file;
  for (const char* file : {"identification", "retrieval", "diagnosis"}) {
    EXPECT_EQ(plain(json(std::string("kept/") + file + ".json")),
              plain(json(std::string("out/") + file + ".json")));
    EXPECT_EQ(plain(result[file]), plain(json(std::string("out/") + file + ".json")));
  }

  // Stopped as the first step ends: its files are there, those of the next are not, and nothing is half done.
  std::atomic<bool> stop{false};
  IdentificationSettings stopped = s;
  stopped.folder = path("stopped");
  context.stop = &stop;
  context.progress = [&](const std::string& stage, double) { stop = stage.rfind("run ", 0) == 0; };
  EXPECT_THROW(identify_log(stopped, path("log.csv"), context, nullptr), Stopped);
  std::vector<std::string> left;
  for (const auto& entry : fs::directory_iterator(folder / "stopped"))
    left.push_back(entry.path().filename());
  std::sort(left.begin(), left.end());
  EXPECT_EQ(left, (std::vector<std::string>{"identification.json", "identified.yaml"}));
  fs::remove_all(folder);
}

}  // namespace
}  // namespace dynid
