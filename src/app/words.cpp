// SPDX-License-Identifier: Apache-2.0
#include "app/words.hpp"

namespace dynid::detail {

const char* word_for(JointType type) {
  return type == JointType::revolute     ? "revolute"
         : type == JointType::continuous ? "continuous"
                                         : "prismatic";
}

const char* word_for(Identifiable answer) {
  return answer == Identifiable::alone            ? "alone"
         : answer == Identifiable::in_combination ? "in combination"
                                                  : "no";
}

}  // namespace dynid::detail
