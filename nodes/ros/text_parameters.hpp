// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cctype>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "dynid/app/choices.hpp"
#include "dynid/app/option_error.hpp"

namespace dynid {

/// The numbers of a list written as text, with or without brackets: roscpp takes `_name:=[1,2]` on a command
/// line for a text. None where it is not that.
std::optional<std::vector<double>> numbers_in(std::string text);

/// Parameters as text, whether they come from a command line (`_cutoff:=10`) or from a parameter server, read
/// into typed values. A parameter that is not there leaves its value as it is. What cannot be read is thrown
/// as OptionError.
class TextParameters {
 public:
  explicit TextParameters(std::map<std::string, std::string> texts) : texts_(std::move(texts)) {}

  void read(const std::string& name, std::string& value);
  void read(const std::string& name, bool& value);  ///< true, false, 1, 0
  void read(const std::string& name, double& value);
  void read(const std::string& name, int& value);
  void read(const std::string& name, unsigned& value);
  void read(const std::string& name, std::uint64_t& value);
  /// Three numbers, as a list is written on a command line: `[0,0,-9.81]` or `0,0,-9.81`.
  void read(const std::string& name, std::optional<Eigen::Vector3d>& value);
  /// One of the words, in upper or lower case.
  template <class T>
  void read(const std::string& name, T& value, const Choices<T>& choices) {
    std::string word, words;
    if (!find(name, word)) return;
    std::transform(word.begin(), word.end(), word.begin(), [](unsigned char c) { return std::tolower(c); });
    for (const auto& [known, choice] : choices) {
      if (known == word) {
        value = choice;
        return;
      }
      words += (words.empty() ? "" : ", ") + known;
    }
    throw OptionError(name, word + " is none of " + words);
  }

  std::vector<std::string> unread() const;  ///< names that nobody asked for

 private:
  bool find(const std::string& name, std::string& text);

  std::map<std::string, std::string> texts_;
  std::set<std::string> asked_;
};

}  // namespace dynid
