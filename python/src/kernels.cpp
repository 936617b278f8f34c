// SPDX-License-Identifier: Apache-2.0
#include "kernels.hpp"

#include <algorithm>
#include <array>

#include "dynid/dynamics/dynamics.hpp"

namespace dynid::python {
namespace {

template <int N, class Scalar>
using Vector = Eigen::Matrix<Scalar, N, 1>;

constexpr std::ptrdiff_t lanes = 8;

/// Samples `first ..` of rows of n numbers as eight lanes; beyond `count` the last one again.
template <int N>
void take(const double* rows, std::ptrdiff_t first, std::ptrdiff_t count, int n, Vector<N, Packet8>& x) {
  for (std::ptrdiff_t k = 0; k < lanes; ++k) {
    const double* row = rows + std::min(first + k, count - 1) * n;
    for (int j = 0; j < n; ++j) x[j][k] = row[j];
  }
}

template <int N>
void give(const Vector<N, Packet8>& x, std::ptrdiff_t first, std::ptrdiff_t count, int n, double* rows) {
  for (std::ptrdiff_t k = 0; k < std::min(lanes, count - first); ++k) {
    double* row = rows + (first + k) * n;
    for (int j = 0; j < n; ++j) row[j] = x[j][k];
  }
}

/// Calls `use` with Model<n> where n is compiled in, else with the dynamic one.
template <class Use>
void with_model(const Robot& robot, Use use) {
  switch (robot.size()) {
    case 6:
      return use(Model<6>(robot));
    case 7:
      return use(Model<7>(robot));
    default:
      return use(Model<>(robot));
  }
}

template <int N>
using ConstRow = Eigen::Map<const Vector<N, double>>;
template <int N>
using Square = Eigen::Map<Eigen::Matrix<double, N, N, N == 1 ? Eigen::ColMajor : Eigen::RowMajor>>;

void rnea(const Robot& robot, std::ptrdiff_t count, const double* q, const double* dq, const double* ddq,
          const double* armature, double* out) {
  with_model(robot, [=](const auto& model) {
    constexpr int N = std::decay_t<decltype(model)>::fixed_size;
    const int n = model.size();
    if (count == 1) {
      Workspace<N> ws(model);
      Eigen::Map<Vector<N, double>> tau(out, n);
      inverse_dynamics(model, ws, ConstRow<N>(q, n), ConstRow<N>(dq, n), ConstRow<N>(ddq, n), tau);
      for (int j = 0; armature != nullptr && j < n; ++j) tau[j] += armature[j] * ddq[j];
      return;
    }
    // Several packets are turned into lanes ahead of the kernel, which then does not wait for their stores.
    constexpr std::ptrdiff_t ahead = 8;
    Workspace<N, Packet8> ws(model);
    std::array<Vector<N, Packet8>, ahead> x, v, a, tau;
    for (auto* group : {&x, &v, &a, &tau})
      for (Vector<N, Packet8>& packet : *group) packet.resize(n);
    for (std::ptrdiff_t first = 0; first < count; first += ahead * lanes) {
      const auto packets = static_cast<std::size_t>(std::min(ahead, (count - first + lanes - 1) / lanes));
      const auto at = [first](std::size_t p) { return first + static_cast<std::ptrdiff_t>(p) * lanes; };
      for (std::size_t p = 0; p < packets; ++p) {
        take<N>(q, at(p), count, n, x[p]);
        take<N>(dq, at(p), count, n, v[p]);
        take<N>(ddq, at(p), count, n, a[p]);
      }
      for (std::size_t p = 0; p < packets; ++p) {
        inverse_dynamics(model, ws, x[p], v[p], a[p], tau[p]);
        for (int j = 0; armature != nullptr && j < n; ++j) tau[p][j] += armature[j] * a[p][j];
      }
      for (std::size_t p = 0; p < packets; ++p) give<N>(tau[p], at(p), count, n, out);
    }
  });
}

void regressor(const Robot& robot, std::ptrdiff_t count, const double* q, const double* dq, const double* ddq,
               double* out) {
  with_model(robot, [=](const auto& model) {
    constexpr int N = std::decay_t<decltype(model)>::fixed_size;
    constexpr int columns = N == Eigen::Dynamic ? Eigen::Dynamic : 10 * N;
    const int n = model.size();
    Workspace<N> ws(model);
    Eigen::Matrix<double, N, columns> Y(n, 10 * n);
    for (std::ptrdiff_t i = 0; i < count; ++i) {
      regressor(model, ws, ConstRow<N>(q + i * n, n), ConstRow<N>(dq + i * n, n), ConstRow<N>(ddq + i * n, n),
                Y);
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(out + i * 10 * n * n,
                                                                                         n, 10 * n) = Y;
    }
  });
}

void mass_matrix(const Robot& robot, std::ptrdiff_t count, const double* q, const double* armature,
                 double* out) {
  with_model(robot, [=](const auto& model) {
    constexpr int N = std::decay_t<decltype(model)>::fixed_size;
    const int n = model.size();
    Workspace<N> ws(model);
    for (std::ptrdiff_t i = 0; i < count; ++i) {
      Square<N> M(out + i * n * n, n, n);
      mass_matrix(model, ws, ConstRow<N>(q + i * n, n), M);
      for (int j = 0; armature != nullptr && j < n; ++j) M(j, j) += armature[j];
    }
  });
}

void coriolis(const Robot& robot, std::ptrdiff_t count, const double* q, const double* dq, double* out) {
  with_model(robot, [=](const auto& model) {
    constexpr int N = std::decay_t<decltype(model)>::fixed_size;
    const int n = model.size();
    Workspace<N> ws(model);
    Eigen::Matrix<double, N, N> S(n, n);
    for (std::ptrdiff_t i = 0; i < count; ++i) {
      coriolis_matrix(model, ws, ConstRow<N>(q + i * n, n), ConstRow<N>(dq + i * n, n), S);
      Square<N>(out + i * n * n, n, n) = S;
    }
  });
}

void gravity_torque(const Robot& robot, std::ptrdiff_t count, const double* q, double* out) {
  with_model(robot, [=](const auto& model) {
    constexpr int N = std::decay_t<decltype(model)>::fixed_size;
    const int n = model.size();
    Workspace<N, Packet8> ws(model);
    Vector<N, Packet8> x(n), g(n);
    for (std::ptrdiff_t i = 0; i < count; i += lanes) {
      take<N>(q, i, count, n, x);
      gravity(model, ws, x, g);
      give<N>(g, i, count, n, out);
    }
  });
}

void forward(const Robot& robot, std::ptrdiff_t count, const double* q, const double* dq, const double* tau,
             const double* armature, double* out) {
  with_model(robot, [=](const auto& model) {
    constexpr int N = std::decay_t<decltype(model)>::fixed_size;
    const int n = model.size();
    Workspace<N> ws(model);
    const Vector<N, double> inertia =
        armature != nullptr ? Vector<N, double>(ConstRow<N>(armature, n)) : Vector<N, double>::Zero(n);
    for (std::ptrdiff_t i = 0; i < count; ++i) {
      Eigen::Map<Vector<N, double>> ddq(out + i * n, n);
      forward_dynamics(model, ws, ConstRow<N>(q + i * n, n), ConstRow<N>(dq + i * n, n),
                       ConstRow<N>(tau + i * n, n), ddq, inertia);
    }
  });
}

void tip_jacobian(const Robot& robot, std::ptrdiff_t count, const double* q, double* out) {
  with_model(robot, [=](const auto& model) {
    constexpr int N = std::decay_t<decltype(model)>::fixed_size;
    const int n = model.size();
    Workspace<N> ws(model);
    Eigen::Matrix<double, 6, N> J(6, n);
    for (std::ptrdiff_t i = 0; i < count; ++i) {
      jacobian(model, ws, ConstRow<N>(q + i * n, n), J);
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(out + i * 6 * n, 6,
                                                                                         n) = J;
    }
  });
}

}  // namespace
}  // namespace dynid::python

extern "C" __attribute__((visibility("default"))) const dynid::python::Kernels* dynid_python_kernels() {
  using namespace dynid::python;
  static const Kernels table = {&rnea,           &regressor, &mass_matrix, &coriolis,
                                &gravity_torque, &forward,   &tip_jacobian};
  return &table;
}
