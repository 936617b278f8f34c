// SPDX-License-Identifier: Apache-2.0
#include "rigid_body.hpp"

#include <algorithm>

#include "dynid/dynamics/inverse_dynamics.hpp"
#include "dynid/dynamics/joint_scale.hpp"
#include "dynid/dynamics/kinematics.hpp"
#include "dynid/dynamics/mass_matrix.hpp"
#include "dynid/friction/friction.hpp"

namespace dynid::detail {
namespace {

template <int N>
class Compiled : public RigidBody {
 public:
  explicit Compiled(const Robot& robot) : model_(robot), ws_(model_) {}
  void inverse(const Eigen::VectorXd& q, const Eigen::VectorXd& dq, const Eigen::VectorXd& ddq,
               Eigen::VectorXd& tau) noexcept override {
    inverse_dynamics(model_, ws_, q, dq, ddq, tau);
  }
  void mass(const Eigen::VectorXd& q, Eigen::MatrixXd& M) noexcept override {
    mass_matrix(model_, ws_, q, M);
  }
  void poses(const Eigen::VectorXd& q, std::vector<Eigen::Isometry3d>& links) noexcept override {
    forward_kinematics(model_, ws_, q, links);
  }
  void jacobian(const Eigen::VectorXd& q, Eigen::MatrixXd& J) noexcept override {
    dynid::jacobian(model_, ws_, q, model_.tip(), J);
  }

 private:
  Model<N> model_;
  Workspace<N> ws_;
};

}  // namespace

std::unique_ptr<RigidBody> RigidBody::make(const Robot& robot) {
  switch (robot.size()) {
    case 6:
      return std::make_unique<Compiled<6>>(robot);
    case 7:
      return std::make_unique<Compiled<7>>(robot);
    default:
      return std::make_unique<Compiled<Eigen::Dynamic>>(robot);
  }
}

std::vector<JointFriction> smooth_friction(const Robot& robot) {
  std::vector<JointFriction> friction;
  const std::vector<JointScale> scales = joint_scales(robot);
  for (std::size_t j = 0; j < scales.size(); ++j) {
    friction.push_back(robot.joints[j].friction);
    double& width = friction.back().linear.velocity_scale;
    width = std::max(width, least_velocity_scale * scales[j].speed);
  }
  return friction;
}

Eigen::VectorXd rotor_inertias(const Robot& robot) {
  Eigen::VectorXd rotor(robot.size());
  for (int j = 0; j < robot.size(); ++j) rotor[j] = robot.joints[static_cast<std::size_t>(j)].rotor_inertia;
  return rotor;
}

WholeTorque::WholeTorque(const Robot& robot)
    : body_(RigidBody::make(robot)), rotor_(rotor_inertias(robot)), friction_(smooth_friction(robot)) {}

void WholeTorque::operator()(const Eigen::VectorXd& q, const Eigen::VectorXd& dq, const Eigen::VectorXd& ddq,
                             Eigen::VectorXd& tau) noexcept {
  body_->inverse(q, dq, ddq, tau);
  for (Eigen::Index j = 0; j < tau.size(); ++j)
    tau[j] += rotor_[j] * ddq[j] + friction_torque(friction_[static_cast<std::size_t>(j)], dq[j]);
}

}  // namespace dynid::detail
