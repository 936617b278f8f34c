// SPDX-License-Identifier: Apache-2.0
//
// What the sources of the module share.
#pragma once

#include <nanobind/nanobind.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "dynid/app/context.hpp"
#include "dynid/model/coefficient.hpp"

namespace dynid::python {

namespace nb = nanobind;

/// A robot as Python holds it: never changed once it is made, so that threads may share it.
struct PyRobot {
  ModelFile model;
  std::string source;                      ///< file, for messages
  std::vector<std::string> not_expressed;  ///< what of an MJCF it cannot say
  Eigen::VectorXd armature;                ///< n [kg m^2]; empty where every joint has none

  PyRobot(ModelFile file, std::string from) : model(std::move(file)), source(std::move(from)) {
    armature.resize(model.robot.size());
    for (int j = 0; j < model.robot.size(); ++j)
      armature[j] = model.robot.joints[static_cast<std::size_t>(j)].rotor_inertia;
  }
};

/// A job on a thread of its own, so that the caller can listen to Ctrl-C and tell its progress: what Python
/// code may do at any time only on the thread that it is called on.
void wait_for(const std::shared_ptr<struct RunningJob>& job, nb::handle progress);

struct RunningJob {
  std::atomic<bool> stop{false};
  std::mutex mutex;
  std::condition_variable changed;
  bool done = false;
  std::string stage;
  double fraction = -1.0;
  std::exception_ptr error;
  std::thread thread;

  Context context() {
    Context context;
    context.stop = &stop;
    context.progress = [this](const std::string& what, double share) {
      const std::lock_guard<std::mutex> lock(mutex);
      stage = what;
      fraction = share;
    };
    return context;
  }
};

/// run(job, context) without the interpreter lock. `progress`: None or a callable (stage, fraction), called
/// on this thread; what it raises ends the job. KeyboardInterrupt returns within 0.2 s, whatever the job
/// does.
template <class Job>
auto run_job(Job job, nb::handle progress) {
  using Report = decltype(run(job, Context()));
  const auto running = std::make_shared<RunningJob>();
  const auto result = std::make_shared<std::unique_ptr<Report>>();
  running->thread = std::thread([running, result, job = std::move(job)] {
    try {
      *result = std::make_unique<Report>(run(job, running->context()));
    } catch (...) {
      running->error = std::current_exception();
    }
    const std::lock_guard<std::mutex> lock(running->mutex);
    running->done = true;
    running->changed.notify_all();
  });
  wait_for(running, progress);
  return std::move(**result);
}

void bind_robot(nb::module_& m);
void bind_log(nb::module_& m);
void bind_jobs(nb::module_& m);
void bind_estimator(nb::module_& m);

}  // namespace dynid::python
