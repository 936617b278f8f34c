// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <yaml-cpp/yaml.h>

#include <Eigen/Core>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "dynid/base/error.hpp"

namespace dynid::detail {

/// An Error that already says where.
class LocatedError : public Error {
 public:
  using Error::Error;
};

/// A place in a YAML file, read strictly: the one way in which this library reads YAML.
///
/// Every error is an Error `file:line: joints[3].com: what is wrong`, list items counted from 1: an unknown,
/// repeated or missing key, a value of another type, a number that is not finite. Numbers are read whatever
/// the locale.
class YamlItem {
 public:
  /// The root of `text`, which must be a single map with `format: <format>`. `what` says what the file is (`a
  /// model`) where it is not that; `file` names it in errors.
  static YamlItem document(const std::string& text, const std::string& file, const char* format,
                           const char* what);

  /// Throws the LocatedError that says `what` is wrong here.
  [[noreturn]] void fail(const std::string& what) const;

  /// Calls `make`; an Error that does not say where becomes one that does.
  template <class Make>
  auto located(Make make) const {
    try {
      return make();
    } catch (const LocatedError&) {
      throw;
    } catch (const Error& error) {
      fail(error.what());
    }
  }

  /// Refuses what is not a map, a key twice, and every key outside `known`.
  void expect_keys(const std::vector<std::string>& known) const;

  bool has(const std::string& key) const;
  /// The value of `key`, which must be there.
  YamlItem at(const std::string& key) const;
  /// Of a list, in the order of the file.
  std::vector<YamlItem> list() const;
  /// Of a map, in the order of the file; refuses a key twice.
  std::vector<std::pair<std::string, YamlItem>> entries() const;

  double number() const;           ///< finite
  double positive_number() const;  ///< finite, > 0
  int integer() const;
  bool boolean() const;      ///< true or false, no other words
  std::string text() const;  ///< may be empty
  std::string name() const;  ///< a text that is not empty
  /// [lower, upper] with lower <= upper.
  std::pair<double, double> interval() const;
  template <int N>
  Eigen::Matrix<double, N, 1> vector() const;

 private:
  YamlItem(const YAML::Node& node, std::string path, std::shared_ptr<const std::string> file)
      : node_(node), path_(std::move(path)), file_(std::move(file)), mark_(node_.Mark()) {}

  std::string path_of(const std::string& key) const { return path_.empty() ? key : path_ + "." + key; }
  void expect_map() const;
  /// Items of a list that must be `count` long.
  std::vector<YamlItem> numbers(std::size_t count) const;
  const char* kind() const;

  YAML::Node node_;
  std::string path_;
  std::shared_ptr<const std::string> file_;
  YAML::Mark mark_;
};

template <int N>
Eigen::Matrix<double, N, 1> YamlItem::vector() const {
  const std::vector<YamlItem> items = numbers(N);
  Eigen::Matrix<double, N, 1> v;
  for (int k = 0; k < N; ++k) v[k] = items[static_cast<std::size_t>(k)].number();
  return v;
}

}  // namespace dynid::detail
