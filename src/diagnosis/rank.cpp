// SPDX-License-Identifier: Apache-2.0
#include "rank.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "dynid/diagnosis/calibration.hpp"
#include "energy.hpp"

namespace dynid::detail {
namespace {

/// The form error of all effects of a model but one, as variances: of each joint's torque, and through its
/// noise's filter.
struct FormError {
  Eigen::VectorXd size, innovation;
};
FormError form_error(const Choice& choice, const GapModel& model, std::size_t but) {
  const GapRows& rows = choice.rows;
  const int n = rows.joints();
  FormError out{Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n)};
  for (std::size_t k = 0; k < model.effects.size(); ++k) {
    // A window's form error is in the window.
    if (k == but || model.effects[k].h->scope() == Scope::window) continue;
    const double part = model.effects[k].h->approximate() ? choice.criteria().form_of_approximate
                                                          : choice.criteria().form_of_exact;
    const Eigen::MatrixXd torque = part * own_contribution(model, k);
    for (int j = 0; j < n; ++j) {
      if (torque.col(j).isZero(0.0)) continue;
      const ChannelNoise& noise = model.fit.noise[static_cast<std::size_t>(j)];
      const Eigen::MatrixXd white = whitened(rows, torque.col(j), noise);
      out.size[j] += torque.col(j).squaredNorm() / double(rows.size());
      out.innovation[j] += noise.variance * white.squaredNorm() / double(white.rows());
    }
  }
  return out;
}

/// Part of the gap's energy beyond the floor that an effect takes alone.
double explained_alone(const Choice& choice, const GapModel& model, const Eigen::VectorXd& floor) {
  const GapModel alone =
      model.effects.size() == 1 ? model : choice.search.evaluate({model.effects.back()}, model.kappa);
  return std::clamp(shrink_fraction(choice.rows.y, alone.fit.residual, floor), 0.0, 1.0);
}

struct Candidate {
  double score, explained;
};

/// Scores in the place of one effect; "" is nothing there.
std::map<std::string, Candidate> candidates(const Choice& choice, const GapModel& base, const FormError& form,
                                            const Eigen::VectorXd& floor, bool explained,
                                            std::vector<GapModel>& others) {
  const auto score = [&](const GapModel& m) {
    return m.score - m.fit.total + evidence_with_form(choice.rows, m.fit, form.size, form.innovation);
  };
  std::map<std::string, Candidate> out = {{"", {score(base), 0.0}}};
  others = choice.search.alternatives(base, 8);
  for (const GapModel& m : others) {
    const Candidate here{score(m), explained ? explained_alone(choice, m, floor) : 0.0};
    Candidate& best = out.emplace(m.effects.back().h->name(), here).first->second;
    if (here.score > best.score) best = here;
  }
  return out;
}

}  // namespace

std::vector<std::size_t> by_share(const std::vector<double>& shares) {
  std::vector<std::size_t> order(shares.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return shares[a] > shares[b]; });
  return order;
}

double needed(const Choice& choice, const GapModel& model, std::size_t which) {
  const FormError form = form_error(choice, model, which);
  const auto score = [&](const GapModel& m) {
    return m.score - m.fit.total + evidence_with_form(choice.rows, m.fit, form.size, form.innovation);
  };
  const GapModel base = choice.search.evaluate(without(model.effects, which), model.kappa);
  return 1.0 / (1.0 + std::exp((score(base) - score(model)) / calibration().temperature));
}

bool below_form(const Choice& choice, const GapModel& model, std::size_t which) {
  const FormError form = form_error(choice, model, which);
  const Eigen::MatrixXd torque = own_contribution(model, which);
  for (Eigen::Index j = 0; j < torque.cols(); ++j)
    if (torque.col(j).squaredNorm() > form.size[j] * double(torque.rows())) return false;
  return true;
}

Ranked rank(const Choice& choice, const GapModel& model, const std::vector<double>& shares, double explained,
            const Eigen::VectorXd& floor) {
  const double temperature = calibration().temperature;
  Ranked out{std::vector<double>(model.effects.size()),
             std::vector<std::vector<std::string>>(model.effects.size()),
             {}};
  std::map<std::string, RankedEffect> ranking;
  for (const std::string& name : choice.search.names()) ranking[name].name = name;
  // Not only the others compared may be right instead, but none of them.
  const auto sure = [&](double part) {
    return 1.0 - std::min(0.99, calibration().doubt + calibration().doubt_of_rest * (1.0 - part));
  };
  const auto put_first = [&](const std::map<std::string, Candidate>& all, double top, double certain) {
    double sum = 0.0;
    for (const auto& [name, c] : all) sum += std::exp((c.score - top) / temperature);
    for (const auto& [name, c] : all)
      if (!name.empty())
        ranking[name] = {name, certain * std::exp((c.score - top) / temperature) / sum, c.explained};
  };
  const std::vector<std::size_t> order = by_share(shares);
  std::vector<GapModel> others;
  for (const std::size_t k : order) {
    const std::string mine = model.effects[k].h->name();
    const FormError form = form_error(choice, model, k);
    std::map<std::string, Candidate> all =
        candidates(choice, choice.search.evaluate(without(model.effects, k), model.kappa), form, floor,
                   k == order.front(), others);
    const double own = model.score - model.fit.total +
                       evidence_with_form(choice.rows, model.fit, form.size, form.innovation);
    all[mine] = {own,
                 k == order.front()
                     ? explained_alone(choice, choice.search.evaluate({model.effects[k]}, model.kappa), floor)
                     : 0.0};
    double sum = 0.0;
    for (const auto& [name, c] : all) sum += std::exp((c.score - own) / temperature);
    out.probability[k] = sure(explained) / sum;
    for (const GapModel& m : others) {
      const std::string name = m.effects.back().h->name();
      std::vector<std::string>& aliases = out.aliases[k];
      if (name != mine && m.fit.total > model.fit.total - choice.criteria().indistinct &&
          std::find(aliases.begin(), aliases.end(), name) == aliases.end())
        aliases.push_back(name);
    }
    if (k == order.front()) put_first(all, own, sure(explained));
  }
  if (model.effects.empty()) {
    const FormError none{Eigen::VectorXd::Zero(choice.rows.joints()),
                         Eigen::VectorXd::Zero(choice.rows.joints())};
    const auto all = candidates(choice, choice.search.none(model.kappa), none, floor, true, others);
    double top = -std::numeric_limits<double>::infinity(), most = 0.0;
    for (const auto& [name, c] : all)
      if (c.score > top) top = c.score, most = c.explained;
    put_first(all, top, sure(most));
  }
  for (const auto& [name, r] : ranking) out.ranking.push_back(r);
  std::stable_sort(out.ranking.begin(), out.ranking.end(), [](const RankedEffect& a, const RankedEffect& b) {
    return a.probability > b.probability;
  });
  return out;
}

}  // namespace dynid::detail
