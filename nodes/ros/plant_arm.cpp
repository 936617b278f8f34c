// SPDX-License-Identifier: Apache-2.0
#include "ros/plant_arm.hpp"

#include <cmath>
#include <string>

#include "dynid/base/error.hpp"
#include "dynid/simulation/effect_catalogue.hpp"
#include "dynid/simulation/perturbed.hpp"

namespace dynid {
namespace {

constexpr double lost = 2.0;      // [rad or m]
constexpr double rising = 5e-3;   // [s] time constant of a push
constexpr double nothing = 1e-6;  // [N or N m] of a push that has gone

Plant make_plant(const Robot& model, const PlantArmOptions& options) {
  Robot truth = perturbed(model, options.spread, options.seed);
  truth.effects.clear();
  for (const std::vector<Effect>* list : {&model.effects, &options.effects})
    for (const Effect& effect : *list) truth.effects.push_back(complete_effect(effect, model));
  PlantOptions plant_options;
  plant_options.measurement = MeasurementOptions::realistic(options.noise);
  plant_options.seed = options.seed;
  return Plant(truth, plant_options);
}

}  // namespace

PlantArm::PlantArm(const Robot& model, const Eigen::VectorXd& initial, const PlantArmOptions& options)
    : period_(options.period),
      push_timeout_(options.push_timeout),
      plant_(make_plant(model, options)),
      control_(model),
      reference_(initial),
      q_d_(initial),
      dq_d_(Eigen::VectorXd::Zero(initial.size())),
      ddq_d_(dq_d_),
      tau_(dq_d_) {
  if (initial.size() != model.size())
    throw Error("plant: an initial position of " + std::to_string(initial.size()) +
                " joints for a robot of " + std::to_string(model.size()));
  strongest_.resize(model.size());
  for (Eigen::Index j = 0; j < strongest_.size(); ++j)
    strongest_[j] = model.joints[static_cast<std::size_t>(j)].limits.torque;
  control_(q_d_, dq_d_, ddq_d_, q_d_, dq_d_, 0.0, tau_);
  plant_.reset(q_d_, dq_d_, tau_);
}

void PlantArm::step() {
  reference_.at(time_, q_d_, dq_d_, ddq_d_);
  Eigen::Index worst = 0;
  if (!((plant_.seen_q() - q_d_).cwiseAbs().maxCoeff(&worst) < lost))
    throw Error("plant: joint " + std::to_string(worst + 1) + " left its motion at " + std::to_string(time_) +
                " s");
  if (time_ >= push_ends_) push_.setZero();
  applied_ += (1.0 - std::exp(-period_ / rising)) * (push_ - applied_);
  if (push_.isZero(0.0) && applied_.isZero(nothing)) applied_.setZero();
  plant_.set_tip_wrench(applied_, tip_axes_);
  control_(q_d_, dq_d_, ddq_d_, plant_.measured_q(), plant_.measured_dq(), period_, tau_);
  tau_ = tau_.cwiseMin(strongest_).cwiseMax(-strongest_);  // infinite where it is not known
  plant_.step(tau_, period_);
  time_ += period_;
}

void PlantArm::push(const Eigen::Matrix<double, 6, 1>& wrench, bool tip_axes) noexcept {
  if (!wrench.allFinite()) return;
  push_ = wrench;
  push_ends_ = time_ + push_timeout_;
  // What is still going keeps its axes.
  if (!wrench.isZero(0.0)) tip_axes_ = tip_axes;
}

}  // namespace dynid
