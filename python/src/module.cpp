// SPDX-License-Identifier: Apache-2.0
#include <dlfcn.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <list>

#include "binding.hpp"
#include "cli/program.hpp"
#include "dynid/app/option_error.hpp"
#include "dynid/base/error.hpp"
#include "kernels.hpp"
#include "loaded_kernels.hpp"

namespace dynid::python {
namespace {

/// Jobs that were left behind by Ctrl-C and are still on their way to where they look.
std::list<std::shared_ptr<RunningJob>>& abandoned() {
  static std::list<std::shared_ptr<RunningJob>> jobs;
  return jobs;
}

/// At exit: none may outlive what it works with.
void join_abandoned() {
  const nb::gil_scoped_release release;
  for (const auto& job : abandoned())
    if (job->thread.joinable()) job->thread.join();
  abandoned().clear();
}

/// Without the lock, which the thread may need to give back what it holds of Python.
void join(std::thread& thread) {
  const nb::gil_scoped_release release;
  thread.join();
}

void leave(const std::shared_ptr<RunningJob>& job) {
  job->stop = true;
  bool done = false;
  {
    const nb::gil_scoped_release release;
    std::unique_lock<std::mutex> lock(job->mutex);
    done = job->changed.wait_for(lock, std::chrono::milliseconds(100), [&] { return job->done; });
  }
  if (done)
    join(job->thread);
  else
    abandoned().push_back(job);
}

const Kernels*& kernels_in_use() {
  static const Kernels* table = dynid_python_kernels();
  return table;
}

/// The kernels compiled for x86-64-v3, from the file at `path`, where this machine has it. Returns whether.
bool load_kernels(const std::string& path) {
#if defined(__x86_64__)
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma") || !__builtin_cpu_supports("bmi2"))
    return false;
#else
  return false;
#endif
  void* const library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) return false;
  using Get = const Kernels* (*)();
  const auto get = reinterpret_cast<Get>(dlsym(library, "dynid_python_kernels"));
  if (get != nullptr) kernels_in_use() = get();
  return get != nullptr;
}

int run_main(const std::vector<std::string>& arguments) {
  std::vector<std::string> words = arguments;
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const nb::gil_scoped_release release;
  return run_program(static_cast<int>(words.size()), argv.data());
}

}  // namespace

const Kernels& kernels() { return *kernels_in_use(); }

void wait_for(const std::shared_ptr<RunningJob>& job, nb::handle progress) {
  double told = -1.0;
  for (;;) {
    std::string stage;
    double fraction = -1.0;
    bool done = false;
    {
      const nb::gil_scoped_release release;
      std::unique_lock<std::mutex> lock(job->mutex);
      done = job->changed.wait_for(lock, std::chrono::milliseconds(20), [&] { return job->done; });
      stage = job->stage;
      fraction = job->fraction;
    }
    try {
      if (!progress.is_none() && fraction > told) progress(stage, told = fraction);
    } catch (...) {
      leave(job);
      throw;
    }
    if (done) break;
    if (PyErr_CheckSignals() != 0) {
      const nb::python_error interrupted;  // takes it from the interpreter while the job is left
      leave(job);
      throw interrupted;
    }
  }
  join(job->thread);
  if (job->error) std::rethrow_exception(job->error);
}

}  // namespace dynid::python

NB_MODULE(_core, m) {
  using namespace dynid::python;
  m.doc() = "The library, as the package `dynid` calls it.";
  nb::exception<dynid::Error>(m, "Error", PyExc_ValueError).doc() =
      "Bad input: one line, which says what and where.";
  nb::exception<dynid::Stopped>(m, "Stopped").doc() = "The job was stopped.";
  bind_robot(m);
  bind_log(m);
  bind_jobs(m);
  bind_estimator(m);
  m.def("load_kernels", &load_kernels, nb::arg("path"));
  m.def("main", &run_main, nb::arg("arguments"), "The command-line program; returns its exit status.");
  m.def("join_abandoned", &join_abandoned);
  m.attr("version") = DYNID_VERSION;
}
