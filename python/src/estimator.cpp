// SPDX-License-Identifier: Apache-2.0
//
// dynid.Estimator: TorqueEstimator step by step.
#include <nanobind/eigen/dense.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "binding.hpp"
#include "dynid/estimation/torque_estimator.hpp"

namespace dynid::python {
namespace {

using nb::literals::operator""_a;

std::vector<std::string> words_of(Status status) {
  constexpr std::pair<Status, const char*> all[] = {{Status::restarted, "restarted"},
                                                    {Status::bad_input, "bad_input"},
                                                    {Status::stale, "stale"},
                                                    {Status::time_went_back, "time_went_back"},
                                                    {Status::gap, "gap"},
                                                    {Status::limits_exceeded, "limits_exceeded"},
                                                    {Status::near_singular, "near_singular"},
                                                    {Status::model_changed, "model_changed"}};
  std::vector<std::string> words;
  for (const auto& [flag, word] : all)
    if (has(status, flag)) words.emplace_back(word);
  return words;
}

}  // namespace

void bind_estimator(nb::module_& m) {
  nb::class_<Estimate<>>(m, "Estimate", "What a cycle gives; torques [N m]: (n,), base to tip.")
      .def_prop_ro(
          "status", [](const Estimate<>& e) { return words_of(e.status); }, "Empty: all is well.")
      .def_prop_ro(
          "ddq", [](const Estimate<>& e) { return e.ddq; }, "[rad/s^2] that tau_model is for.")
      .def_prop_ro("tau_model", [](const Estimate<>& e) { return e.tau_model; })
      .def_prop_ro("tau_friction", [](const Estimate<>& e) { return e.tau_friction; })
      .def_prop_ro(
          "tau_external", [](const Estimate<>& e) { return e.tau_external; }, "tau_model - tau.")
      .def_prop_ro(
          "residual", [](const Estimate<>& e) { return e.residual; },
          "Of the momentum observer: positive when the environment pushes the robot.")
      .def_prop_ro("contact",
                   [](const Estimate<>& e) {
                     return std::vector<bool>(e.contact.data(), e.contact.data() + e.contact.size());
                   })
      .def_prop_ro(
          "wrench", [](const Estimate<>& e) { return Eigen::VectorXd(e.wrench); },
          "[N, N m] at the tip: (6,).");
  nb::class_<TorqueEstimator<>>(m, "Estimator",
                                "Model torque, external torque, contact and wrench, sample by sample.")
      .def(
          "__init__",
          [](TorqueEstimator<>* self, const PyRobot& robot, std::optional<Eigen::VectorXd> gain,
             std::optional<Eigen::VectorXd> contact_threshold, double acceleration_cutoff) {
            TorqueEstimatorOptions options;
            if (gain) options.gain = *gain;
            if (contact_threshold) options.contact_threshold = *contact_threshold;
            options.acceleration_cutoff = acceleration_cutoff;
            new (self) TorqueEstimator<>(robot.model.robot, options);
          },
          "robot"_a, nb::kw_only(), "gain"_a = nb::none(), "contact_threshold"_a = nb::none(),
          "acceleration_cutoff"_a = 30.0,
          "gain [1/s], contact_threshold [N m]: shape (n,) or (1,); acceleration_cutoff [Hz].")
      .def(
          "step",
          [](TorqueEstimator<>& self, double dt, const Eigen::VectorXd& q, const Eigen::VectorXd& dq,
             const Eigen::VectorXd& tau, const std::optional<Eigen::VectorXd>& ddq) {
            return ddq ? self.step(dt, q, dq, tau, *ddq) : self.step(dt, q, dq, tau);
          },
          "dt"_a, "q"_a, "dq"_a, "tau"_a, "ddq"_a = nb::none(),
          "One cycle. dt [s] since the sample before, q [rad], dq [rad/s], tau [N m], ddq (desired) "
          "[rad/s^2]: (n,).")
      .def(
          "reset", [](TorqueEstimator<>& self) { self.reset(); }, "Forgets the past.")
      .def(
          "adopt",
          [](TorqueEstimator<>& self, const PyRobot& robot) { self.adopt(TorqueModel<>(robot.model.robot)); },
          "robot"_a, "Another model from the next cycle on.");
}

}  // namespace dynid::python
