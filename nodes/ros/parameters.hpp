// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ros/node_handle.h>

#include <Eigen/Core>
#include <limits>
#include <set>
#include <string>
#include <vector>

namespace dynid {

/// Parameters of a node, checked as they are read. What is wrong is thrown as Error, one line that begins
/// with the parameter's full name: `/torque_estimator/wrench_length: -1 is not in (0, 10]`. A parameter that
/// is not set takes the `usual` value; an integer is a number too.
class Parameters {
 public:
  /// handle: in whose namespace the names are, as a rule the node's private one.
  explicit Parameters(const ros::NodeHandle& handle) : handle_(handle) {}

  /// A closed interval; `open_at_lower` takes its lower end out.
  struct Range {
    double lower = -std::numeric_limits<double>::infinity();
    double upper = std::numeric_limits<double>::infinity();
    bool open_at_lower = false;
  };

  bool has(const std::string& name) const;
  double number(const std::string& name, double usual, const Range& range) const;
  bool flag(const std::string& name, bool usual) const;
  std::string text(const std::string& name, const std::string& usual) const;
  std::string required_text(const std::string& name) const;
  std::vector<std::string> texts(const std::string& name) const;  ///< empty where not set
  /// `count` numbers (any number of them where count < 0), each in `range`; a single number gives one. Empty
  /// where not set. A text that is such a list is read too.
  Eigen::VectorXd numbers(const std::string& name, int count, const Range& range) const;
  /// One of `choices`; `usual` where not set.
  std::string choice(const std::string& name, const std::string& usual,
                     const std::vector<std::string>& choices) const;

  /// Full names of what is set in the namespace and was never asked for: misspelt, as a rule.
  std::vector<std::string> unknown() const;

  std::string full(const std::string& name) const;  ///< `/torque_estimator/model`
  /// Throws Error: `<full name>: <what>`.
  [[noreturn]] void refuse(const std::string& name, const std::string& what) const;

 private:
  bool get(const std::string& name, XmlRpc::XmlRpcValue& value) const;

  ros::NodeHandle handle_;
  mutable std::set<std::string> asked_;  // full names
};

}  // namespace dynid
