// SPDX-License-Identifier: Apache-2.0
// Effects of the torque sensor and the encoder: torque_offset, torque_gain, time_delay, encoder_offset,
// torque_saturation.
#include <algorithm>
#include <cmath>

#include "dynid/base/error.hpp"
#include "effect_model.hpp"

namespace dynid::detail {
namespace {

class TorqueOffset : public EffectModel {
 public:
  TorqueOffset(const Effect& effect, const Robot&) : offset_(values(effect, "offset")) {}
  SensorStage stage() const override { return SensorStage::offset; }
  void sense(double, Eigen::VectorXd& tau) override { tau += offset_; }

 private:
  Eigen::VectorXd offset_;
};

class TorqueGain : public EffectModel {
 public:
  TorqueGain(const Effect& effect, const Robot&) : gain_(values(effect, "gain")) {}
  SensorStage stage() const override { return SensorStage::gain; }
  void sense(double, Eigen::VectorXd& tau) override { tau.array() *= 1.0 + gain_.array(); }

 private:
  Eigen::VectorXd gain_;
};

/// The sensor stops at a limit, or the drive does, and what was asked of it is what is seen.
class TorqueSaturation : public EffectModel {
 public:
  TorqueSaturation(const Effect& effect, const Robot& robot)
      : limit_(values(effect, "limit")),
        command_limit_(values(effect, "command_limit")),
        refused_(Eigen::VectorXd::Zero(robot.size())) {}
  bool limits_drives() const override { return command_limit_.maxCoeff() > 0.0; }
  void drive(Eigen::VectorXd& tau) override {
    for (Eigen::Index j = 0; j < tau.size(); ++j) {
      if (!(command_limit_[j] > 0.0)) continue;
      const double given = std::clamp(tau[j], -command_limit_[j], command_limit_[j]);
      refused_[j] = tau[j] - given;
      tau[j] = given;
    }
  }
  SensorStage stage() const override {
    return limits_drives() ? SensorStage::command : SensorStage::saturation;
  }
  void sense(double, Eigen::VectorXd& tau) override {
    for (Eigen::Index j = 0; j < tau.size(); ++j) {
      if (command_limit_[j] > 0.0)
        tau[j] += refused_[j];
      else if (limit_[j] > 0.0)
        tau[j] = std::clamp(tau[j], -limit_[j], limit_[j]);
    }
  }

 private:
  Eigen::VectorXd limit_, command_limit_, refused_;
};

/// A ring of the last torques, read its delay ago by linear interpolation.
class TimeDelay : public EffectModel {
 public:
  TimeDelay(const Effect& effect, const Robot& robot) : delay_(Eigen::VectorXd::Zero(robot.size())) {
    const Eigen::VectorXd own = values(effect, "channel_delay_s");
    for (const int joint : effect.joints) {
      double& delay = delay_[joint - 1];
      delay = own[joint - 1] != 0.0 ? own[joint - 1] : value(effect, "delay_s");
      if (delay < 0.0)
        throw Error("effect 'time_delay': no sensor makes the torque of joint " + std::to_string(joint) +
                    " early, by " + std::to_string(-delay) + " s");
    }
    tau_.resize(robot.size(), capacity);
    t_.resize(capacity);
  }
  SensorStage stage() const override { return SensorStage::delay; }
  void reset_sensor(double t, const Eigen::VectorXd& tau) override {
    newest_ = 0;
    count_ = 1;
    t_[0] = t;
    tau_.col(0) = tau;
  }
  void sense(double t, Eigen::VectorXd& tau) override {
    newest_ = (newest_ + 1) % capacity;
    count_ = std::min(count_ + 1, capacity);
    t_[newest_] = t;
    tau_.col(newest_) = tau;
    for (Eigen::Index j = 0; j < tau.size(); ++j)
      if (delay_[j] > 0.0) tau[j] = at(j, t - delay_[j]);
  }

 private:
  double at(Eigen::Index joint, double wanted) const {
    Eigen::Index after = newest_;
    for (int k = 1; k < count_; ++k) {
      const Eigen::Index before = (newest_ - k + capacity) % capacity;
      if (t_[before] <= wanted) {
        const double part = (wanted - t_[before]) / (t_[after] - t_[before]);
        return tau_(joint, before) + part * (tau_(joint, after) - tau_(joint, before));
      }
      after = before;
    }
    return tau_(joint, after);  // from before the start
  }

  static constexpr Eigen::Index capacity = 4096;
  Eigen::VectorXd delay_;
  Eigen::MatrixXd tau_;
  Eigen::VectorXd t_;
  Eigen::Index newest_ = 0, count_ = 0;
};

class EncoderOffset : public EffectModel {
 public:
  EncoderOffset(const Effect& effect, const Robot&) : offset_(values(effect, "offset")) {}
  void add_encoder_offset(Eigen::VectorXd& offset) const override { offset += offset_; }

 private:
  Eigen::VectorXd offset_;
};

/// A limit that the joint's gravity torque meets.
void draw_limit(Effect& effect, const Robot& robot, std::mt19937_64& random, double strength, double) {
  const Eigen::VectorXd peak = gravity_peaks(robot, random);
  for (const int joint : effect.joints)
    effect.parameters["limit"][static_cast<std::size_t>(joint - 1)] =
        std::max(1e-4 * peak.maxCoeff(),
                 peak[joint - 1] * (1.0 - std::min(strength, 1.5) * uniform(random, 0.3, 0.6)));
}

}  // namespace

std::vector<EffectDefinition> sensor_effects() {
  return {
      {"torque_offset", {{"offset", {0.5}, {2.0}, true, Scale::times}}, &make_model<TorqueOffset>},
      {"torque_gain", {{"gain", {0.08}, {0.25}, true, Scale::times}}, &make_model<TorqueGain>, nullptr, 0.05},
      {"time_delay",
       {{"delay_s", {0.008}, {0.03}, false, Scale::times},
        {"channel_delay_s", {0.0}, {0.0}, false, Scale::none}},
       &make_model<TimeDelay>},
      {"encoder_offset",
       {{"offset", {0.02}, {0.08}, true, Scale::times}},
       &make_model<EncoderOffset>,
       nullptr,
       0.05},
      {"torque_saturation",
       {{"limit", {5.0}, {30.0}, false, Scale::none}, {"command_limit", {0.0}, {0.0}, false, Scale::none}},
       &make_model<TorqueSaturation>,
       &draw_limit,
       0.5},
  };
}

}  // namespace dynid::detail
