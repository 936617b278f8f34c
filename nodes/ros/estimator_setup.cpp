// SPDX-License-Identifier: Apache-2.0
#include "ros/estimator_setup.hpp"

#include "dynid/base/error.hpp"

namespace dynid {

EstimatorModel read_estimator_model(const Parameters& parameters) {
  EstimatorModel model;
  model.path = parameters.required_text("model");
  const bool ignore = parameters.choice("uncompensated_effects", "refuse", {"refuse", "ignore"}) == "ignore";
  try {
    model.file = read_model_file(model.path, parameters.text("base", ""), parameters.text("tip", ""),
                                 Consistency::warn, &model.broken);
    model.uncertainty = read_uncertainty(model.path);
    // Throws where an effect has not what it needs, or cannot run in the loop.
    TorqueModel<>(model.file.robot, ignore ? Uncompensated::ignore : Uncompensated::refuse);
  } catch (const Error& error) {
    parameters.refuse("model", error.what());
  }
  model.uncompensated = uncompensated_effects(model.file.robot);
  return model;
}

LinkInertia read_estimator_payload(const Parameters& parameters) {
  LinkInertia payload;
  payload.mass = parameters.number("payload/mass", 0.0, {0.0, 1000.0});
  const Eigen::VectorXd com = parameters.numbers("payload/com", 3, {-10.0, 10.0});
  if (com.size() == 3) payload.com = com;
  const Eigen::VectorXd inertia = parameters.numbers("payload/inertia", 6, {-1000.0, 1000.0});
  if (inertia.size() == 6)
    payload.inertia << inertia[0], inertia[1], inertia[2], inertia[1], inertia[3], inertia[4], inertia[2],
        inertia[4], inertia[5];
  if (payload.mass == 0.0 && inertia.size() == 6 && !payload.inertia.isZero())
    parameters.refuse("payload/inertia", "a payload without mass has none");
  const double margin = consistency_margins(payload).triangle;
  if (margin < -1e-9)
    parameters.refuse("payload/inertia", "breaks eq. (16): no body has this inertia, margin " +
                                             std::to_string(margin) + " kg m^2");
  return payload;
}

EstimatorSetup read_estimator_setup(const Parameters& parameters) {
  EstimatorSetup setup;
  setup.model = read_estimator_model(parameters);
  const Robot& robot = setup.model.file.robot;
  const int n = robot.size();

  setup.joints = parameters.texts("joint_names");
  if (setup.joints.empty())
    for (const Joint& joint : robot.joints) setup.joints.push_back(joint.name);
  if (static_cast<int>(setup.joints.size()) != n)
    parameters.refuse("joint_names",
                      std::to_string(n) + " names needed, not " + std::to_string(setup.joints.size()));
  for (std::size_t i = 0; i < setup.joints.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (setup.joints[i] == setup.joints[j])
        parameters.refuse("joint_names", "'" + setup.joints[i] + "' is there twice");

  const auto over_joints = [&](const char* name, const Parameters::Range& range) {
    Eigen::VectorXd given = parameters.numbers(name, -1, range);
    if (given.size() != 0 && given.size() != 1 && given.size() != n)
      parameters.refuse(name,
                        "1 value or " + std::to_string(n) + " needed, not " + std::to_string(given.size()));
    return given;
  };
  TorqueEstimatorOptions& options = setup.core.estimator;
  options.gain = over_joints("gain", {0.0, 1000.0, true});
  options.contact_threshold = over_joints("contact_threshold", {0.0, 1000.0, true});
  const auto every = [n](const Eigen::VectorXd& given, const Eigen::VectorXd& usual) -> Eigen::VectorXd {
    return given.size() == n ? given : given.size() == 1 ? Eigen::VectorXd::Constant(n, given[0]) : usual;
  };
  Eigen::VectorXd torque_limit(n);
  for (int i = 0; i < n; ++i) torque_limit[i] = robot.joints[static_cast<std::size_t>(i)].limits.torque;
  options.gain = every(options.gain, Eigen::VectorXd::Constant(n, TorqueEstimator<>::usual_gain));
  options.contact_threshold =
      every(options.contact_threshold, TorqueEstimator<>::usual_contact_threshold(torque_limit));
  const std::string order = parameters.choice("observer_order", "first", {"first", "second", "kalman"});
  options.order = order == "first"    ? ObserverOrder::first
                  : order == "second" ? ObserverOrder::second
                                      : ObserverOrder::kalman;
  options.damping = parameters.number("observer_damping", 1.0, {0.0, 1.0, true});
  options.longest_dt = parameters.number("longest_gap", 0.1, {0.0, 10.0, true});
  options.bridge = parameters.number("bridge", 0.003, {0.0, 10.0});
  if (options.bridge >= options.longest_dt) parameters.refuse("bridge", "must be less than longest_gap");
  options.wrench.length = parameters.number("wrench_length", 0.25, {0.0, 10.0, true});
  options.wrench.singular_below = parameters.number("singular_below", 0.04, {0.0, 10.0, true});
  const double alarms = parameters.number("false_alarms_per_hour", 0.0, {0.0, 3600.0});
  if (alarms > 0.0) {
    options.uncertainty = setup.model.uncertainty;
    options.test.false_alarms_per_hour = alarms;
  }
  if (options.order == ObserverOrder::kalman && !options.uncertainty)
    parameters.refuse("observer_order",
                      "kalman needs ~false_alarms_per_hour and a model file with `uncertainty:`, which "
                      "dynid identify --out writes");
  // dynamic_reconfigure would clip these without a word.
  parameters.number("gain_factor", 1.0, {0.01, 100.0});
  parameters.number("threshold_factor", 1.0, {0.01, 100.0});
  parameters.number("contact_release", 0.6, {0.0, 1.0});
  parameters.number("acceleration_cutoff", 30.0, {0.1, 1000.0});

  setup.core.zero_acceleration =
      parameters.choice("acceleration", "estimated", {"estimated", "zero"}) == "zero";
  setup.core.longest_age = parameters.number("longest_age", 0.5, {0.0, 1e6});
  setup.core.wrench_near_singularities =
      parameters.choice("singular_wrench", "withhold", {"withhold", "damped"}) == "damped";

  setup.frames.prefix = parameters.text("tf_prefix", "");
  const Eigen::VectorXd gravity = parameters.numbers("gravity", 3, {-100.0, 100.0});
  if (gravity.size() == 3) setup.frames.gravity = gravity;
  setup.frames.gravity_frame = parameters.text("gravity_frame", "world");
  setup.frames.wrench_frame = parameters.text("wrench_frame", "");
  setup.payload = read_estimator_payload(parameters);
  if (const std::string assume = parameters.text("assume", ""); !assume.empty()) {
    try {
      const Assumptions assumed = parse_stream_assumptions(assume, n);
      setup.core.reading = MessageReading(assumed, robot);
      if (assumed.gravity && setup.frames.gravity)
        throw Error("gravity: ~gravity is given too: leave one of them out");
      if (assumed.gravity) setup.frames.gravity = assumed.gravity;
    } catch (const Error& error) {
      parameters.refuse("assume", error.what());
    }
    setup.assumed = true;
  }

  setup.topic = parameters.text("topic", "joint_states");
  setup.queue = static_cast<int>(parameters.number("queue", 20.0, {1.0, 1000.0}));
  setup.silence = parameters.number("silence", 0.5, {0.0, 3600.0, true});
  setup.tf_period = parameters.number("tf_period", 1.0, {0.01, 3600.0});
  setup.reading_window = parameters.number("reading_window", 60.0, {0.0, 3600.0});
  setup.diagnostic_period = parameters.number("diagnostic_period", 1.0, {0.05, 3600.0});
  return setup;
}

}  // namespace dynid
