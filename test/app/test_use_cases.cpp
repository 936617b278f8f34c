// SPDX-License-Identifier: Apache-2.0
// Every use case: what it tells, how it stops, which options it refuses.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <functional>
#include <limits>
#include <thread>

#include "app/small_problems.hpp"
#include "dynid/app/blind.hpp"
#include "dynid/app/choices.hpp"
#include "dynid/app/demo.hpp"
#include "dynid/app/export.hpp"
#include "dynid/app/friction.hpp"
#include "dynid/app/info.hpp"
#include "dynid/app/option_error.hpp"
#include "dynid/app/report.hpp"
#include "dynid/app/reverse.hpp"
#include "dynid/app/simulate.hpp"
#include "dynid/app/torque.hpp"
#include "dynid/base/file.hpp"
#include "dynid/base/number.hpp"
#include "dynid/model/yaml.hpp"
#include "dynid/retrieval/bounds.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;
using test::Listener;

// ---------------------------------------------------------------------------------------------- progress

/// Law: fractions are within 0..1 and never fall; some are told before the end, and one rises.
void expect_rising(const Listener& listener) {
  ASSERT_GE(listener.told.size(), 2u);
  double last = 0.0;
  for (const auto& [stage, fraction] : listener.told) {
    EXPECT_FALSE(stage.empty());
    EXPECT_GE(fraction, last) << stage;
    EXPECT_LE(fraction, 1.0) << stage;
    last = fraction;
  }
  EXPECT_GT(last, listener.told.front().second);
}

TEST(Progress, OfIdentifyRises) {
  Listener listener;
  IdentifyJob job = test::identify_job();
  job.validation = job.logs;  // a second round of filtering: its own fractions begin anew
  job.options.friction = FrictionLaw::sigmoid;
  run(job, listener.context());
  expect_rising(listener);
}

TEST(Progress, OfRetrieveRisesToOne) {
  Listener listener;
  run(test::retrieve_job(), listener.context());
  expect_rising(listener);
  EXPECT_EQ(listener.told.size(), 3u);
  EXPECT_EQ(listener.told.back().first, "run 3 of 3");
  EXPECT_EQ(listener.told.back().second, 1.0);
}

TEST(Progress, OfExciteRises) {
  Listener listener;
  run(test::excite_job(), listener.context());
  expect_rising(listener);
}

TEST(Progress, OfDiagnoseRises) {
  Listener listener;
  DiagnoseJob job = test::diagnose_job();
  job.reference = test::small_log();
  run(job, listener.context());
  expect_rising(listener);
}

TEST(Progress, OfAPartIsThatPartOfTheWhole) {
  Listener listener;
  const Context whole = listener.context();
  const Context inner = whole.part(0.2, 0.6).part(0.5, 1.0);
  inner.report("half of it", 0.5);
  ASSERT_EQ(listener.told.size(), 1u);
  EXPECT_DOUBLE_EQ(listener.told[0].second, 0.5);
  listener.stop = true;
  EXPECT_THROW(inner.report("no more", 0.6), Stopped);
  EXPECT_EQ(listener.told.size(), 1u);
}

// -------------------------------------------------------------------------------------------------- stops

TEST(Stop, EndsALongRetrieval) {
  Listener listener;
  listener.stop_after = 1;
  RetrieveJob job = test::retrieve_job();
  job.options.runs = 100000;  // hours
  EXPECT_THROW(run(job, listener.context()), Stopped);
  EXPECT_LT(listener.seconds_since_stop(), 10.0);
  EXPECT_LE(listener.told.size(), 2u);
}

TEST(Stop, GivesTheBestRetrievalSoFarWhereThatIsWanted) {
  Listener listener;
  listener.stop_after = 2;
  RetrieveJob job = test::retrieve_job();
  job.options.runs = 100000;
  job.keep_best_when_stopped = true;
  const RetrieveReport report = run(job, listener.context());
  EXPECT_TRUE(report.result.interrupted);
  EXPECT_TRUE(report.succeeded());
  EXPECT_NE(report.note.find("interrupted"), std::string::npos) << report.note;
  EXPECT_TRUE(inconsistencies(report.robot, 0.0).empty());
}

TEST(Stop, EndsADiagnosisAtTheNextStage) {
  std::size_t all = 0;
  {
    Listener listener;
    run(test::diagnose_job(), listener.context());
    all = listener.told.size();
  }
  ASSERT_GE(all, 4u);
  for (std::size_t k = 1; k < 4; ++k) {
    Listener listener;
    listener.stop_after = k;
    EXPECT_THROW(run(test::diagnose_job(), listener.context()), Stopped);
    EXPECT_EQ(listener.told.size(), k);
  }
}

TEST(Stop, EndsTheSearchForAMotionAndABlindBank) {
  {
    Listener listener;
    listener.stop_after = 1;
    ExciteJob job = test::excite_job();
    job.options.starts = 10000;  // an hour
    EXPECT_THROW(run(job, listener.context()), Stopped);
    EXPECT_EQ(listener.told.size(), 1u);
  }
  Listener listener;
  listener.stop_after = 1;
  BlindJob job;
  job.nominal = test::panda();
  job.options.cases = 10000;  // hours
  job.options.duration = 6.0;
  job.options.rate = 100.0;
  job.options.diagnose.surrogates = 19;
  const fs::path folder = fs::path(::testing::TempDir()) / "dynid_app_blind";
  fs::remove_all(folder);
  job.options.folder = folder.string();
  EXPECT_THROW(run(job, listener.context()), Stopped);
  EXPECT_LE(listener.told.size(), 1u + std::thread::hardware_concurrency());  // those that were under way
  fs::remove_all(folder);
}

/// Law: a job that is asked to stop before it begins does nothing and tells nothing.
TEST(Stop, IsSeenByEveryUseCaseBeforeItBegins) {
  Listener listener;
  listener.stop = true;
  const Context context = listener.context();
  const IdentifyJob identify = test::identify_job();
  EXPECT_THROW(run(identify, context), Stopped);
  EXPECT_THROW(run(FrictionJob{identify.robot, "panda", identify.logs, identify.options, ""}, context),
               Stopped);
  EXPECT_THROW(run(ReverseJob{identify.robot, "panda", {}, {}}, context), Stopped);
  EXPECT_THROW(run(TorqueJob{identify.robot, identify.logs.front()}, context), Stopped);
  EXPECT_THROW(run(test::retrieve_job(), context), Stopped);
  EXPECT_THROW(run(test::excite_job(), context), Stopped);
  EXPECT_THROW(run(test::diagnose_job(), context), Stopped);
  EXPECT_THROW(run(InfoJob{identify.robot}, context), Stopped);
  SimulateJob simulate;
  simulate.robot = identify.robot;
  EXPECT_THROW(run(simulate, context), Stopped);
  BlindJob blind;
  blind.nominal = identify.robot;
  EXPECT_THROW(run(blind, context), Stopped);
  ExportJob exported;
  exported.model.robot = identify.robot;
  EXPECT_THROW(run(exported, context), Stopped);
  EXPECT_THROW(run(DemoJob{identify.robot, "panda", "log", 1, {}, {}, {}}, context), Stopped);
  PipelineJob pipeline;
  pipeline.robot = identify.robot;
  pipeline.log = test::small_log();
  EXPECT_THROW(run(pipeline, context), Stopped);
  EXPECT_TRUE(listener.told.empty());
}

// ------------------------------------------------------------------------------------------------ options

/// Law: run() and check_options() both refuse it, by the option's name and with the value, whatever the data.
template <class Job>
void expect_refused(const Job& job, const std::string& option, const std::string& rule) {
  for (const bool running : {false, true}) {
    try {
      if (running)
        run(job);
      else
        check_options(job);
      ADD_FAILURE() << option << ": not refused";
    } catch (const OptionError& error) {
      EXPECT_EQ(error.option(), option);
      EXPECT_NE(error.rule().find(rule), std::string::npos) << error.what();
      EXPECT_EQ(std::string(error.what()), option + ": " + error.rule());
    }
  }
}

template <class Job, class Change>
void expect_refused(Job job, const std::string& option, const std::string& rule, const Change& change) {
  change(job);
  expect_refused(job, option, rule);
}

TEST(Options, OutOfRangeAreRefusedByName) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expect_refused(IdentifyJob{}, "cutoff", "-1 is negative", [](auto& j) { j.options.prepare.cutoff = -1; });
  expect_refused(IdentifyJob{}, "cutoff", "nan", [&](auto& j) { j.options.prepare.cutoff = nan; });
  expect_refused(IdentifyJob{}, "prune", "-30", [](auto& j) { j.options.prune_percent = -30; });
  expect_refused(FrictionJob{}, "cutoff", "-1", [](auto& j) { j.options.prepare.cutoff = -1; });
  expect_refused(ReverseJob{}, "prune", "-1", [](auto& j) { j.options.prune_percent = -1; });
  expect_refused(TorqueJob{}, "cutoff", "-1", [](auto& j) { j.cutoff = -1; });
  expect_refused(RetrieveJob{}, "runs", "0 is not positive", [](auto& j) { j.options.runs = 0; });
  expect_refused(RetrieveJob{}, "steps", "0", [](auto& j) { j.options.steps = 0; });
  expect_refused(RetrieveJob{}, "threads", "-1", [](auto& j) { j.options.threads = -1; });
  expect_refused(RetrieveJob{}, "agree", "-1", [](auto& j) { j.options.agreeing_runs = -1; });
  expect_refused(RetrieveJob{}, "cutoff", "-1", [](auto& j) { j.cutoff = -1; });
  expect_refused(ExciteJob{}, "harmonics", "0 is not within 1..50", [](auto& j) { j.options.harmonics = 0; });
  expect_refused(ExciteJob{}, "harmonics", "51", [](auto& j) { j.options.harmonics = 51; });
  expect_refused(ExciteJob{}, "period", "0 is not positive", [](auto& j) { j.options.duration = 0; });
  expect_refused(ExciteJob{}, "base_period", "-2", [](auto& j) { j.options.base_period = -2; });
  expect_refused(ExciteJob{}, "rate", "0", [](auto& j) { j.rate = 0; });
  expect_refused(ExciteJob{}, "ramp", "-1", [](auto& j) { j.options.ramp = -1; });
  expect_refused(ExciteJob{}, "margin", "0.5 is not within 0..0.49", [](auto& j) { j.options.margin = 0.5; });
  expect_refused(ExciteJob{}, "starts", "0", [](auto& j) { j.options.starts = 0; });
  expect_refused(ExciteJob{}, "effort", "9", [](auto& j) { j.options.effort = 9; });
  expect_refused(ExciteJob{}, "threads", "-1", [](auto& j) { j.options.threads = -1; });
  expect_refused(SimulateJob{}, "duration", "0", [](auto& j) { j.duration = 0; });
  expect_refused(SimulateJob{}, "noise", "-1", [](auto& j) { j.noise = -1; });
  expect_refused(SimulateJob{}, "rate", "nan", [&](auto& j) { j.rate = nan; });
  expect_refused(SimulateJob{}, "spread", "0.5", [](auto& j) { j.spread = 0.5; });
  expect_refused(DiagnoseJob{}, "cutoff", "-1", [](auto& j) { j.options.cutoff = -1; });
  expect_refused(DiagnoseJob{}, "tolerance", "-0.1", [](auto& j) { j.options.tolerance = -0.1; });
  expect_refused(DiagnoseJob{}, "withhold", "gremlins is not friction, payload or the name of an effect",
                 [](auto& j) {
                   j.withhold = {"payload", "gremlins"};
                 });
  expect_refused(BlindJob{}, "cases", "0", [](auto& j) { j.options.cases = 0; });
  expect_refused(ExportJob{}, "into", "urdf", [](auto& j) {
    j.format = ExportFormat::sdf;
    j.into = ExportJob::Into{"<robot/>", "a.urdf"};
  });
  // Of a step of the pipeline, too, before the first begins.
  expect_refused(PipelineJob{}, "steps", "0", [](auto& j) {
    j.retrieve.emplace();
    j.retrieve->options.steps = 0;
  });
  expect_refused(PipelineJob{}, "tolerance", "-1", [](auto& j) {
    j.diagnose.emplace();
    j.diagnose->options.tolerance = -1;
  });
}

TEST(Options, HaveTheNameOfTheCommandLineThere) {
  EXPECT_EQ(OptionError("base_period", "-1 is negative").on_command_line(), "--base-period: -1 is negative");
  try {
    parse_effects({"payload:mass=1,com=0:0:0.1", "payload:weight=1"}, test::panda());
    ADD_FAILURE();
  } catch (const OptionError& error) {
    EXPECT_EQ(error.option(), "effect");
    EXPECT_NE(error.rule().find("payload:weight=1: "), std::string::npos) << error.what();
  }
}

TEST(Options, WordsAndValuesAreOneToOne) {
  const auto check = [](const auto& choices) {
    for (const auto& [word, value] : choices) EXPECT_EQ(word_for(choices, value), word);
  };
  check(friction_laws());
  check(methods());
  check(motion_sources());
  check(motion_kinds());
  check(excitation_criteria());
  check(blind_kinds());
  check(export_formats());
}

// ----------------------------------------------------------------------------------------------- pipeline

TEST(Pipeline, IsItsStepsOneByOne) {
  PipelineJob job;
  job.robot = test::panda();
  job.source = "panda";
  job.log = test::small_log();
  job.identify.options.prepare.cutoff = 10.0;
  job.retrieve = RetrieveJob{};
  job.retrieve->bounds = read_bounds(std::string(DYNID_SOURCE_DIR) + "/config/panda_bounds.yaml");
  job.retrieve->options.runs = 1;
  job.retrieve->options.steps = 2;
  job.diagnose = DiagnoseJob{};
  job.diagnose->options.surrogates = 39;
  job.diagnose->options.replay = false;
  std::vector<std::string> ended;
  job.identified = [&](const IdentifyReport&) { ended.emplace_back("identify"); };
  job.retrieved = [&](const RetrieveReport&) { ended.emplace_back("retrieve"); };
  job.diagnosed = [&](const DiagnoseReport&) { ended.emplace_back("diagnose"); };
  Listener listener;
  const PipelineReport all = run(job, listener.context());
  expect_rising(listener);
  EXPECT_EQ(ended, (std::vector<std::string>{"identify", "retrieve", "diagnose"}));
  EXPECT_TRUE(all.succeeded());

  const IdentifyReport identified = run(test::identify_job());
  EXPECT_EQ(to_yaml(all.identify.model()), to_yaml(identified.model()));
  RetrieveJob retrieve = *job.retrieve;
  retrieve.model = identified.model();
  retrieve.source = "the coefficients identified from small";
  EXPECT_EQ(to_yaml(all.retrieve->model()), to_yaml(run(retrieve).model()));
  DiagnoseJob diagnose = *job.diagnose;
  diagnose.nominal = job.robot;
  diagnose.logs = {job.log};
  const DiagnoseReport diagnosed = run(diagnose);
  EXPECT_EQ(all.diagnose->diagnosis.p_value, diagnosed.diagnosis.p_value);
  EXPECT_EQ(all.diagnose->diagnosis.explained, diagnosed.diagnosis.explained);
  EXPECT_EQ(all.diagnose->diagnosis.verdict, diagnosed.diagnosis.verdict);

  // Stopped between two steps: what ended before was told, what comes after never begins.
  ended.clear();
  Listener stopped;
  job.identified = [&](const IdentifyReport&) {
    ended.emplace_back("identify");
    stopped.stop = true;
  };
  EXPECT_THROW(run(job, stopped.context()), Stopped);
  EXPECT_EQ(ended, std::vector<std::string>{"identify"});
}

TEST(Retrieve, AsksForEveryCoefficientAndForBoundsOfEveryLink) {
  RetrieveJob job = test::retrieve_job();
  job.model.coefficients.pop_back();
  try {
    run(job);
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("two links: coefficients: "), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find(" is missing"), std::string::npos) << error.what();
  }
  job = test::retrieve_job();
  job.bounds.lower.conservativeResize(10);
  job.bounds.upper.conservativeResize(10);
  EXPECT_THROW(run(job), Error);
}

TEST(Diagnose, NamesThePatchAndTheCommand) {
  const DiagnoseReport report = run(test::diagnose_job());
  ASSERT_FALSE(report.diagnosis.effects.empty());
  EXPECT_EQ(report.diagnosis.effects.front().effect.name, "viscous_friction");
  const auto patch = report.patch();
  ASSERT_TRUE(patch.has_value());
  EXPECT_EQ(patch->note, "effects found by diagnosis of viscous");
  EXPECT_EQ(to_yaml(*patch), to_yaml({patched(test::panda(), report.diagnosis.effects), {}, patch->note}));

  DiagnoseCommand command;
  command.model = "my arm.yaml";
  command.logs = {"a.csv", "it's.csv"};
  command.cutoff = 8.0;
  command.report = "r.html";
  EXPECT_EQ(command.line(),
            "dynid diagnose --model 'my arm.yaml' --log a.csv 'it'\\''s.csv' --cutoff 8.0 --report r.html");
  EXPECT_NE(report.html("the command", "1").find("the command"), std::string::npos);
}

// Law: a healthy log has the effects that the model names; what it says beyond them is the model's, and what
// the others have beyond both is found.
TEST(Diagnose, AReferenceHasTheEffectsOfItsModel) {
  Robot robot = test::panda();
  for (Joint& joint : robot.joints) joint.friction = {};  // of one law: what is identified is the plant's
  robot.effects = {{"joint_spring",
                    {2, 4},
                    {{"stiffness", {0, 12, 0, 9, 0, 0, 0}}, {"rest", {0, 0.2, 0, -1.5, 0, 0, 0}}}}};
  const auto log = [&](unsigned long seed, const std::vector<Effect>& more) {
    SimulateJob job;
    job.robot = robot;
    job.effects = more;
    job.duration = 12.0;
    job.seed = seed;
    Log out = run(job).run.log;
    out.source = "log" + std::to_string(seed);
    return out;
  };
  const std::vector<Effect> viscous = {{"viscous_friction", {3}, {{"coefficient", {0, 0, 1.5, 0, 0, 0, 0}}}}};
  DiagnoseJob job;
  job.nominal = robot;
  job.reference = log(1, {});
  job.logs = {log(2, viscous), log(3, viscous)};
  const DiagnoseReport report = run(job);
  EXPECT_EQ(report.nominal.effects.size(), 1u);
  ASSERT_FALSE(report.diagnosis.effects.empty()) << to_string(report.diagnosis.verdict);
  const FoundEffect& first = report.diagnosis.effects.front();
  EXPECT_EQ(first.effect.name, "viscous_friction");
  EXPECT_NEAR(first.effect.parameters.at("coefficient")[2], 1.5, 0.1);
  EXPECT_GT(first.share, 0.9);
  for (const FoundEffect& e : report.diagnosis.effects) EXPECT_NE(e.effect.name, "joint_spring");
}

// --------------------------------------------------------------------------------------- how a log is read

TEST(Assume, FrictionOfATurnedLogIsThatOfTheRightOne) {
  const IdentifyJob identify = test::identify_job();
  const FrictionReport right = run(FrictionJob{identify.robot, "panda", identify.logs, identify.options, ""});
  EXPECT_TRUE(right.conventions.conventions.empty()) << right.conventions.assume;
  std::vector<Log> turned = identify.logs;
  for (Log& log : turned) log.tau = -log.tau;
  for (const char* assume : {"torque_sign=-1", "auto"}) {
    const FrictionReport read = run(FrictionJob{identify.robot, "panda", turned, identify.options, assume});
    EXPECT_TRUE(read.conventions_applied);
    EXPECT_EQ(to_yaml(read.model()), to_yaml(right.model())) << assume;
  }
  const FrictionReport warned = run(FrictionJob{identify.robot, "panda", turned, identify.options, ""});
  EXPECT_FALSE(warned.conventions_applied);
  EXPECT_EQ(warned.conventions.assume, "torque_sign=-1");
}

/// The same numbers as twelve programs write them.
std::vector<std::pair<std::string, std::string>> twelve_dialects(const Log& log) {
  const int n = log.joints();
  struct Form {
    const char *name, *separator, *end, *quote, *before;
    char point;
    std::vector<std::string> words;  // of time, q, dq, tau; # is the joint
    int first;
  };
  const std::vector<std::string> plain = {"t", "q#", "dq#", "tau#"};
  const std::vector<Form> forms = {
      {"commas", ",", "\n", "", "", '.', plain, 1},
      {"semicolons", ";", "\n", "", "", '.', plain, 1},
      {"tabs", "\t", "\n", "", "", '.', plain, 1},
      {"blanks", "  ", "\n", "", "", '.', plain, 1},
      {"decimal comma", ";", "\n", "", "", ',', plain, 1},
      {"carriage returns", ",", "\r\n", "", "", '.', plain, 1},
      {"quotes", ",", "\n", "\"", "", '.', plain, 1},
      {"byte order mark", ",", "\n", "", "\xEF\xBB\xBF", '.', plain, 1},
      {"trailing separator", ",", ",\n", "", "", '.', plain, 1},
      {"from zero", ",", "\n", "", "# noon\n", '.', {"time", "q_#", "qd_#", "effort_#"}, 0},
      {"PlotJuggler",
       ",",
       "\n",
       "",
       "",
       '.',
       {"__time", "/joint_states/panda_joint#/position", "/joint_states/panda_joint#/velocity",
        "/joint_states/panda_joint#/effort"},
       1},
      {"RTDE",
       " ",
       "\n",
       "",
       "",
       '.',
       {"timestamp", "actual_q_#", "actual_qd_#", "actual_current_as_torque_#"},
       0}};
  std::vector<std::pair<std::string, std::string>> out;
  for (const Form& form : forms) {
    std::string text = form.before;
    const auto cell = [&](const std::string& value, bool first) {
      text += (first ? "" : form.separator) + (form.quote + value) + form.quote;
    };
    const auto number = [&](double x) {
      std::string value = exact_number(x);
      if (const auto at = value.find('.'); at != std::string::npos) value[at] = form.point;
      return value;
    };
    cell(form.words[0], true);
    for (std::size_t role = 1; role < 4; ++role)
      for (int j = 0; j < n; ++j) {
        std::string word = form.words[role];
        cell(word.replace(word.find('#'), 1, std::to_string(j + form.first)), false);
      }
    text += form.end;
    for (Eigen::Index i = 0; i < log.samples(); ++i) {
      cell(number(log.t[i]), true);
      for (const Eigen::MatrixXd* x : {&log.q, &log.dq, &log.tau})
        for (int j = 0; j < n; ++j) cell(number((*x)(i, j)), false);
      text += form.end;
    }
    out.emplace_back(form.name, text);
  }
  return out;
}

TEST(Assume, TwelveDialectsOfALogGiveTheSameModelToTheByte) {
  Log log = test::small_log();
  log.ddq.resize(0, 0);
  const std::string path = ::testing::TempDir() + "dynid_twelve_" + std::to_string(::getpid()) + ".csv";
  std::string model;
  const auto dialects = twelve_dialects(log);
  EXPECT_EQ(dialects.size(), 12u);
  for (const auto& [name, text] : dialects) {
    write_file(path, text);
    IdentifyJob job = test::identify_job();
    job.logs = {read_log(path, 7)};
    job.options.validate = false;
    const std::string made = to_yaml(run(job).model());
    if (model.empty()) model = made;
    EXPECT_EQ(made, model) << name;
  }
  fs::remove(path);
}

}  // namespace
}  // namespace dynid
