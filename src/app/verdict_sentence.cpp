// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "dynid/app/report.hpp"
#include "dynid/base/text.hpp"
#include "dynid/diagnosis/servo_diagnose.hpp"
#include "report_words.hpp"

namespace dynid {
namespace {

/// What comes nearest where nothing is named, and why it is not.
std::string nearest(const Diagnosis& d) {
  const auto most = std::max_element(
      d.ranking.begin(), d.ranking.end(),
      [](const RankedEffect& a, const RankedEffect& b) { return a.explained < b.explained; });
  if (most == d.ranking.end() || !(most->explained > 0.0)) return ".";
  return ". Nearest comes " + with_spaces(most->name) + ", which alone takes " +
         detail::page_percent(most->explained) + " of it, with a probability of " +
         detail::page_number(most->probability) + ".";
}

bool says(const Diagnosis& d, const char* criterion) {
  return std::any_of(d.judgement.begin(), d.judgement.end(),
                     [&](const Judgement& j) { return j.criterion == criterion; });
}

/// One effect: its name, where it is, and what these logs cannot tell from it.
std::string in_words(const FoundEffect& e, Eigen::Index joints) {
  const std::string where = detail::joints_in_words(e.effect.joints, joints);
  std::string cause = with_spaces(e.effect.name);
  const auto mass = std::find_if(e.parameters.begin(), e.parameters.end(),
                                 [](const ParameterEstimate& p) { return p.key == "mass"; });
  if (e.effect.name == "payload" && mass != e.parameters.end())
    cause = "a payload of " + detail::page_number(mass->value[0]) + " kg";
  else if (!where.empty())
    cause += " on " + where;
  if (e.aliases.empty()) return cause;
  std::vector<std::string> others;
  for (const std::string& a : e.aliases) others.push_back(with_spaces(a));
  return cause + " (or " + list_in_words(others) + ", which these logs cannot tell from it)";
}

/// What is said of the part of the gap that the named effects leave.
std::string rest(const Diagnosis& d) {
  if (!says(d, "set_explains")) return "the rest is none of the known effects.";
  std::vector<std::string> others;
  for (const ConsideredEffect& c : d.considered)
    if (std::none_of(d.effects.begin(), d.effects.end(),
                     [&](const FoundEffect& e) { return e.effect.name == c.name; }))
      others.push_back(with_spaces(c.name) + " at " + detail::page_number(c.probability));
  return "what causes the rest cannot be told; nearest comes " + list_in_words(others) + ".";
}

}  // namespace

std::string verdict_sentence(const Diagnosis& d) {
  // An effect that is next to nothing of all of the gap is no cause of it, though it is one of a joint's own.
  std::vector<std::string> causes, small;
  for (const FoundEffect& e : d.effects)
    (e.share < Criteria{}.least_share ? small : causes).push_back(in_words(e, d.rms.size()));
  if (causes.empty()) causes.swap(small);
  const std::string beside = small.empty()
                                 ? ""
                                 : "; " + list_in_words(small) + (small.size() > 1 ? " are" : " is") +
                                       " less than a hundredth of it, but much of one joint's own";
  const std::string shrink = detail::page_percent(std::max(0.0, d.shrink.fraction));
  const bool several = causes.size() > 1;
  switch (d.verdict) {
    case Verdict::no_gap:
      return of_motion(d)
                 ? "No gap: under the same commands the model moves as the robot does, to within noise and "
                   "tolerance."
                 : "No gap: the model's torques agree with the robot's to within the noise.";
    case Verdict::not_detected:
      return "No cause can be named: model and robot differ by no more than an inexact model may.";
    case Verdict::explained:
      return capitalised(list_in_words(causes)) + (several ? " explain" : " explains") + " the gap: with " +
             (several ? "them" : "it") + " in the model, " + shrink +
             " of it goes away on data that took no part" + beside + ".";
    case Verdict::partly_explained:
      if (says(d, "nominal_opposes"))
        return capitalised(list_in_words(causes)) + (several ? " are" : " is") +
               " missing from the model, but the gap does not shrink by " + (several ? "them" : "it") +
               " alone: the model's own parameters are off, about " + detail::page_percent(d.nominal_error) +
               ", and work against " + (several ? "them" : "it") + "; identify them.";
      return capitalised(list_in_words(causes)) + (several ? " explain" : " explains") +
             " part of the gap: " + shrink + " of it goes away on data that took no part" + beside + "; " +
             rest(d);
    case Verdict::unexplained:
      return "There is a gap, and none of the known effects explains it" + nearest(d);
    case Verdict::misread: {
      std::vector<std::string> texts;
      for (const Convention& c : d.conventions.conventions) texts.push_back(c.text);
      return "The log does not mean what the model takes it to mean: " + join(texts, "; ") +
             "; read it with --assume " + d.conventions.assume + ".";
    }
    case Verdict::data_invalid:
      break;
  }
  return "These logs cannot be judged: see the data issues.";
}

}  // namespace dynid
