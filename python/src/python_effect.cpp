// SPDX-License-Identifier: Apache-2.0
#include "python_effect.hpp"

#include <nanobind/eigen/dense.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "binding.hpp"
#include "dynid/base/error.hpp"

namespace dynid::python {
namespace {

/// Torque of one joint, linear in its coefficients, as a Python object's `columns(motion, joint)` makes it.
class PythonEffect : public Hypothesis {
 public:
  explicit PythonEffect(const nb::object& effect)
      : effect_(new nb::object(effect)),
        name_(nb::cast<std::string>(effect.attr("name"))),
        keys_(nb::cast<std::vector<std::pair<std::string, std::string>>>(effect.attr("parameters"))),
        prior_(nb::cast<double>(effect.attr("prior"))) {
    if (keys_.empty()) throw Error("effect '" + name_ + "': parameters: at least one (key, unit) is needed");
  }
  PythonEffect(const PythonEffect&) = delete;
  PythonEffect& operator=(const PythonEffect&) = delete;
  ~PythonEffect() override {
    const nb::gil_scoped_acquire acquire;
    delete effect_;
  }

  std::string name() const override { return name_; }
  double prior(const Robot& /*nominal*/) const override { return prior_; }

  ColumnBlock columns(const GapMotion& motion, int unit, const Eigen::VectorXd&) const override {
    const nb::gil_scoped_acquire acquire;
    try {
      nb::dict along;
      along["t"] = motion.t;
      along["q"] = motion.q;
      along["dq"] = motion.dq;
      along["ddq"] = motion.ddq;
      along["tau"] = motion.tau;
      along["nominal"] = motion.nominal;
      Eigen::MatrixXd values = nb::cast<Eigen::MatrixXd>((*effect_).attr("evaluate")(along, unit));
      if (values.rows() != motion.samples() || values.cols() != static_cast<Eigen::Index>(keys_.size()))
        throw Error("effect '" + name_ + "': columns() gave shape (" + std::to_string(values.rows()) + ", " +
                    std::to_string(values.cols()) + "), (" + std::to_string(motion.samples()) + ", " +
                    std::to_string(keys_.size()) + ") is needed");
      if (!values.allFinite())
        throw Error("effect '" + name_ + "': columns() gave a number that is not finite");
      return {{unit}, {std::move(values)}};
    } catch (nb::python_error& error) {
      throw Error("effect '" + name_ + "': " + nb::cast<std::string>(nb::str(error.value())));
    }
  }

  std::vector<NamedValue> parameters(const Robot&, int, const Eigen::VectorXd& c,
                                     const Eigen::VectorXd&) const override {
    std::vector<NamedValue> values;
    for (std::size_t k = 0; k < keys_.size(); ++k)
      values.push_back(
          {keys_[k].first, keys_[k].second, Eigen::VectorXd::Constant(1, c[static_cast<Eigen::Index>(k)])});
    return values;
  }

  void restore(const Robot&, const Effect& effect, int unit, Eigen::VectorXd& c,
               Eigen::VectorXd& shape) const override {
    c.resize(static_cast<Eigen::Index>(keys_.size()));
    shape.resize(0);
    for (std::size_t k = 0; k < keys_.size(); ++k) {
      const auto found = effect.parameters.find(keys_[k].first);
      if (found == effect.parameters.end() || static_cast<int>(found->second.size()) <= unit)
        throw Error("effect '" + name_ + "': parameter '" + keys_[k].first + "' is missing");
      c[static_cast<Eigen::Index>(k)] = found->second[static_cast<std::size_t>(unit)];
    }
  }

 private:
  const nb::object* effect_;
  std::string name_;
  std::vector<std::pair<std::string, std::string>> keys_;
  double prior_;
};

}  // namespace

std::vector<std::unique_ptr<Hypothesis>> python_effects(const std::vector<nb::object>& effects) {
  std::vector<std::unique_ptr<Hypothesis>> all;
  for (const nb::object& effect : effects) all.push_back(std::make_unique<PythonEffect>(effect));
  return all;
}

}  // namespace dynid::python
