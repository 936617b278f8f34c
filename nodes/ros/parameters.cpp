// SPDX-License-Identifier: Apache-2.0
#include "ros/parameters.hpp"

#include <XmlRpcValue.h>

#include <algorithm>
#include <cmath>

#include "dynid/base/error.hpp"
#include "dynid/base/number.hpp"
#include "dynid/base/text.hpp"
#include "ros/text_parameters.hpp"

namespace dynid {

namespace {

using XmlRpc::XmlRpcValue;

const char* kind(const XmlRpcValue& value) {
  switch (value.getType()) {
    case XmlRpcValue::TypeBoolean:
      return "true or false";
    case XmlRpcValue::TypeInt:
    case XmlRpcValue::TypeDouble:
      return "a number";
    case XmlRpcValue::TypeString:
      return "a text";
    case XmlRpcValue::TypeArray:
      return "a list";
    case XmlRpcValue::TypeStruct:
      return "a group of parameters";
    default:
      return "of an unknown type";
  }
}

bool is_number(const XmlRpcValue& value) {
  return value.getType() == XmlRpcValue::TypeInt || value.getType() == XmlRpcValue::TypeDouble;
}

double number_of(XmlRpcValue value) {
  return value.getType() == XmlRpcValue::TypeInt ? static_cast<int>(value) : static_cast<double>(value);
}

// Empty where x is in the range.
std::string complaint(double x, const Parameters::Range& range) {
  if (!std::isnan(x) && (range.open_at_lower ? x > range.lower : x >= range.lower) && x <= range.upper &&
      std::isfinite(x))
    return {};
  return short_number(x) + " is not in " + (range.open_at_lower || std::isinf(range.lower) ? "(" : "[") +
         short_number(range.lower) + ", " + short_number(range.upper) + (std::isinf(range.upper) ? ")" : "]");
}

}  // namespace

std::string Parameters::full(const std::string& name) const { return handle_.resolveName(name); }

void Parameters::refuse(const std::string& name, const std::string& what) const {
  throw Error(full(name) + ": " + what);
}

bool Parameters::get(const std::string& name, XmlRpcValue& value) const {
  asked_.insert(full(name));
  return handle_.getParam(name, value);
}

std::vector<std::string> Parameters::unknown() const {
  std::vector<std::string> set, names;
  handle_.getParamNames(set);
  const std::string inside = handle_.getNamespace() + "/";
  for (const std::string& name : set) {
    if (name.compare(0, inside.size(), inside) != 0) continue;
    if (asked_.count(name) == 0) names.push_back(name);
  }
  return names;
}

bool Parameters::has(const std::string& name) const { return handle_.hasParam(name); }

double Parameters::number(const std::string& name, double usual, const Range& range) const {
  XmlRpcValue value;
  if (!get(name, value)) return usual;
  if (!is_number(value)) refuse(name, std::string("a number is needed, this is ") + kind(value));
  const double x = number_of(value);
  const std::string wrong = complaint(x, range);
  if (!wrong.empty()) refuse(name, wrong);
  return x;
}

bool Parameters::flag(const std::string& name, bool usual) const {
  XmlRpcValue value;
  if (!get(name, value)) return usual;
  if (value.getType() != XmlRpcValue::TypeBoolean)
    refuse(name, std::string("true or false is needed, this is ") + kind(value));
  return value;
}

std::string Parameters::text(const std::string& name, const std::string& usual) const {
  XmlRpcValue value;
  if (!get(name, value)) return usual;
  if (value.getType() != XmlRpcValue::TypeString)
    refuse(name, std::string("a text is needed, this is ") + kind(value));
  return value;
}

std::string Parameters::required_text(const std::string& name) const {
  std::string value = text(name, "");
  if (value.empty()) refuse(name, "not set, and there is no default");
  return value;
}

std::vector<std::string> Parameters::texts(const std::string& name) const {
  XmlRpcValue value;
  if (!get(name, value)) return {};
  if (value.getType() != XmlRpcValue::TypeArray)
    refuse(name, std::string("a list of texts is needed, this is ") + kind(value));
  std::vector<std::string> all;
  for (int i = 0; i < value.size(); ++i) {
    if (value[i].getType() != XmlRpcValue::TypeString)
      refuse(name, "entry " + std::to_string(i + 1) + ": a text is needed, this is " + kind(value[i]));
    all.push_back(value[i]);
  }
  return all;
}

Eigen::VectorXd Parameters::numbers(const std::string& name, int count, const Range& range) const {
  XmlRpcValue value;
  if (!get(name, value)) return {};
  Eigen::VectorXd all;
  if (is_number(value)) {
    all = Eigen::VectorXd::Constant(1, number_of(value));
  } else if (value.getType() == XmlRpcValue::TypeArray) {
    all.resize(value.size());
    for (int i = 0; i < value.size(); ++i) {
      if (!is_number(value[i]))
        refuse(name, "entry " + std::to_string(i + 1) + ": a number is needed, this is " + kind(value[i]));
      all[i] = number_of(value[i]);
    }
  } else if (value.getType() == XmlRpcValue::TypeString) {
    const auto numbers = numbers_in(value);
    if (!numbers)
      refuse(name, "a list of numbers is needed, such as [0, 0, -9.81], this is the text '" +
                       std::string(value) + "'");
    all = Eigen::Map<const Eigen::VectorXd>(numbers->data(), static_cast<Eigen::Index>(numbers->size()));
  } else {
    refuse(name, std::string("a list of numbers is needed, this is ") + kind(value));
  }
  if (count >= 0 && all.size() != count)
    refuse(name, std::to_string(count) + " values needed, not " + std::to_string(all.size()));
  for (Eigen::Index i = 0; i < all.size(); ++i) {
    const std::string wrong = complaint(all[i], range);
    if (!wrong.empty())
      refuse(name, all.size() == 1 ? wrong : "entry " + std::to_string(i + 1) + ": " + wrong);
  }
  return all;
}

std::string Parameters::choice(const std::string& name, const std::string& usual,
                               const std::vector<std::string>& choices) const {
  std::string value = text(name, usual);
  if (std::find(choices.begin(), choices.end(), value) != choices.end()) return value;
  refuse(name, "'" + value + "' is none of " + join(choices));
}

}  // namespace dynid
