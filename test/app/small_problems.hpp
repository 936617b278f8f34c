// SPDX-License-Identifier: Apache-2.0
// Jobs on small simulated data, quick to run.
#pragma once

#include <chrono>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "dynid/app/diagnose.hpp"
#include "dynid/app/excite.hpp"
#include "dynid/app/identify.hpp"
#include "dynid/app/pipeline.hpp"
#include "dynid/app/retrieve.hpp"
#include "identification/synthetic.hpp"
#include "retrieval/problems.hpp"

namespace dynid::test {

inline const Log& small_log() {
  static const Log log = [] {
    Log made = synthetic_log(with_linear_friction(panda()), 1, 12.0, 100.0, 0.02);
    made.source = "small";
    return made;
  }();
  return log;
}

inline IdentifyJob identify_job() {
  IdentifyJob job;
  job.robot = panda();
  job.source = "panda";
  job.logs = {small_log()};
  job.options.prepare.cutoff = 10.0;
  return job;
}

/// Two links, their coefficients exact.
inline RetrieveJob retrieve_job() {
  const std::vector<LinkInertia> bodies = testing::two_link_truth();
  RetrieveJob job;
  job.model.robot = testing::two_link_robot(bodies);
  job.source = "two links";
  const BaseParameters base = base_parameters(job.model.robot);
  const Eigen::VectorXd values = base.K * parameter_vector(job.model.robot, base);
  for (int k = 0; k < base.size(); ++k) {
    const auto i = static_cast<std::size_t>(k);
    job.model.coefficients.push_back({base.names[i], base.expressions[i], values[k], 1.0, true});
  }
  const Eigen::VectorXd p = stack(bodies);
  job.bounds.lower = p.array() - 0.5 * p.array().abs() - 0.1;
  job.bounds.upper = p.array() + 0.5 * p.array().abs() + 0.1;
  for (int i = 0; i < 2; ++i) job.bounds.lower[10 * i] = 0.1;
  job.bounds.source = "bounds";
  job.options.runs = 3;
  job.options.steps = 2;
  job.options.threads = 1;
  job.options.global_evaluations = 200;
  return job;
}

/// The arm carries what its model does not have.
inline DiagnoseJob diagnose_job() {
  DiagnoseJob job;
  job.nominal = panda();
  Robot truth = job.nominal;
  truth.joints[3].friction.linear.viscous += 2.0;
  job.logs = {synthetic_log(truth, 3, 12.0, 100.0, 0.02)};
  job.logs.front().source = "viscous";
  job.options.surrogates = 39;
  job.options.replay = false;
  return job;
}

inline ExciteJob excite_job() {
  ExciteJob job;
  job.robot = panda();
  job.options.starts = 2;
  job.options.effort = 20;
  job.options.threads = 1;
  job.rate = 100.0;
  return job;
}

/// What a use case told.
class Listener {
 public:
  Context context() {
    Context context;
    context.progress = [this](const std::string& stage, double fraction) {
      told.emplace_back(stage, fraction);
      if (told.size() == stop_after) {
        stop = true;
        stopped_at = std::chrono::steady_clock::now();
      }
    };
    context.stop = &stop;
    return context;
  }
  double seconds_since_stop() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - stopped_at).count();
  }

  std::vector<std::pair<std::string, double>> told;
  std::size_t stop_after = 0;  ///< asks for a stop with this call; 0: never
  std::atomic<bool> stop{false};
  std::chrono::steady_clock::time_point stopped_at;
};

}  // namespace dynid::test
