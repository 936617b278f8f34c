// SPDX-License-Identifier: Apache-2.0
#include "search.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace dynid::detail {
namespace {

constexpr std::size_t reshaped_first = 4;  // what comes after these does not become the best by its shape
constexpr std::size_t spare_refined = 4;   // beyond as many as are fitted jointly: a grid is coarse
constexpr std::size_t always_refined = 2;  // however far they are from what is of interest
constexpr double least_exchange = 0.1;     // nat: less is a matter of a shape's last steps

/// Rows in which no window of the effects acts; all, where they leave too few.
std::vector<Eigen::Index> outside_windows(const GapRows& rows, const std::vector<Adopted>& effects) {
  std::vector<Eigen::Index> out, all;
  for (Eigen::Index i = 0; i < rows.size(); ++i) {
    all.push_back(i);
    bool acts = false;
    for (const Adopted& e : effects)
      for (const UnitShape& u : e.units)
        for (std::size_t c = 0; e.h->scope() == Scope::window && c < u.block->channels.size(); ++c)
          acts = acts || !u.block->values[c].row(i).isZero(0.0);
    if (!acts) out.push_back(i);
  }
  return 4 * out.size() > all.size() ? out : all;
}

}  // namespace

Trail::Set Trail::set_of(const GapModel& model) {
  Set out{{}, model.kappa, model.score};
  for (const Adopted& e : model.effects)
    for (const UnitShape& u : e.units) out.units.emplace(e.h, u.unit);
  return out;
}

bool Trail::meets(const GapModel& model, double enough) const {
  const Set here = set_of(model);
  return std::any_of(sets_.begin(), sets_.end(), [&](const Set& s) {
    return s.kappa == here.kappa && s.units == here.units && here.score < s.score + enough;
  });
}

Search::Search(const GapRows& rows, std::vector<const Hypothesis*> library, const Criteria& criteria)
    : by_(rows, criteria), library_(std::move(library)), grids_(library_.size()) {
  struct Job {
    std::size_t h;
    int unit;
    std::size_t point;
  };
  std::vector<Job> jobs;
  for (std::size_t k = 0; k < library_.size(); ++k) {
    const Hypothesis& h = *library_[k];
    grids_[k].resize(static_cast<std::size_t>(h.units(rows.motions().front().robot())));
    for (std::size_t u = 0; u < grids_[k].size(); ++u) {
      for (const Eigen::VectorXd& p : grid_points(by_.rows, h, static_cast<int>(u))) {
        jobs.push_back({k, static_cast<int>(u), grids_[k][u].points.size()});
        grids_[k][u].points.push_back({p, nullptr});
      }
    }
  }
  for (const GapMotion& motion : rows.motions()) motion.keep_shared();
  tbb::parallel_for(std::size_t{0}, jobs.size(), [&](std::size_t k) {
    GridPoint& point = grids_[jobs[k].h][static_cast<std::size_t>(jobs[k].unit)].points[jobs[k].point];
    point.block = std::make_shared<RowBlock>(by_.rows.block(*library_[jobs[k].h], jobs[k].unit, point.shape));
  });
  for (std::size_t k = 0; k < library_.size(); ++k)
    tbb::parallel_for(std::size_t{0}, grids_[k].size(), [&](std::size_t u) {
      UnitGrid& unit = grids_[k][u];
      unit = unit_grid(by_.rows, *library_[k], static_cast<int>(u), std::move(unit.points));
    });
}

Search::Search(const GapRows& rows, const Search& proposer)
    : proposer_(&proposer), by_(rows, proposer.by_.criteria), library_(proposer.library_) {}

std::vector<const RowBlock*> Search::blocks() const {
  std::vector<const RowBlock*> all;
  for (const Grid& grid : grids_)
    for (const UnitGrid& unit : grid)
      for (const GridPoint& point : unit.points) all.push_back(point.block.get());
  return all;
}

std::vector<std::string> Search::names() const {
  std::vector<std::string> out;
  for (const Hypothesis* h : library_) out.push_back(h->name());
  return out;
}

std::vector<GapModel> Search::proposed_elsewhere(const GapModel& base, std::size_t joint_refits,
                                                 double worth) const {
  // The proposer has fewer rows: as many times less evidence.
  const double here = worth * double(proposer_->rows().size()) / double(rows().size());
  std::vector<GapModel> models =
      proposer_->alternatives(proposer_->moved_here(base.effects, base.kappa), joint_refits, here);
  tbb::parallel_for(std::size_t{0}, models.size(),
                    [&](std::size_t k) { models[k] = moved_here(models[k].effects, base.kappa); });
  return models;
}

std::vector<GapModel> Search::alternatives(const GapModel& base, std::size_t joint_refits,
                                           double worth) const {
  constexpr std::size_t remembered = 12;
  if (proposer_ != nullptr) return best_first(proposed_elsewhere(base, joint_refits, worth));
  Asked asked;
  asked.second = {base.kappa, double(joint_refits), worth};
  for (const Adopted& e : base.effects) {
    for (const UnitShape& u : e.units) {
      asked.first.push_back(e.h);
      asked.second.push_back(double(u.unit));
      asked.second.insert(asked.second.end(), u.shape.data(), u.shape.data() + u.shape.size());
    }
  }
  {
    const std::lock_guard<std::mutex> lock(answers_->mutex);
    if (const auto found = answers_->known.find(asked); found != answers_->known.end()) return found->second;
  }
  std::vector<GapModel> models = alternatives_anew(base, joint_refits, worth);
  const std::lock_guard<std::mutex> lock(answers_->mutex);
  if (!answers_->known.emplace(asked, models).second) return models;
  answers_->order.push_back(std::move(asked));
  if (answers_->order.size() > remembered) {
    answers_->known.erase(answers_->order.front());
    answers_->order.pop_front();
  }
  return models;
}

std::vector<GapModel> Search::alternatives_anew(const GapModel& base, std::size_t joint_refits,
                                                double worth) const {
  std::vector<Adopted> proposed(library_.size());
  const Base beginning = by_.base_of(base);
  std::vector<std::size_t> windows, others;
  for (std::size_t k = 0; k < library_.size(); ++k) {
    if (grids_[k].empty()) continue;  // an arm of one joint has no pairs
    // Once each: another joint of it is a matter of the first choice. A further link is a further error.
    const auto same = [&](const Adopted& e) { return e.h->name() == library_[k]->name(); };
    if (library_[k]->scope() != Scope::link && std::any_of(base.effects.begin(), base.effects.end(), same))
      continue;
    (library_[k]->scope() == Scope::window ? windows : others).push_back(k);
  }
  std::vector<Grid> near_by(library_.size());
  tbb::parallel_for(std::size_t{0}, others.size(), [&](std::size_t i) {
    const std::size_t k = others[i];
    near_by[k] = nearest(by_, *library_[k], grids_[k], beginning);
  });
  const auto propose_all = [&](const std::vector<std::size_t>& which, bool refine, double least) {
    tbb::parallel_for(std::size_t{0}, which.size(), [&](std::size_t i) {
      const Grid& grid = near_by[which[i]].empty() ? grids_[which[i]] : near_by[which[i]];
      proposed[which[i]] = propose(by_, *library_[which[i]], grid, beginning, refine, least);
    });
  };
  // What is far from what it has to bring is not looked at any closer.
  const double near = by_.criteria.worth_refining * worth;
  // To refine is what costs: only where a shape may then be among those that are fitted jointly.
  propose_all(others, false, 0.0);
  std::stable_sort(others.begin(), others.end(),
                   [&](std::size_t a, std::size_t b) { return proposed[a].gain > proposed[b].gain; });
  if (others.size() > joint_refits + spare_refined) others.resize(joint_refits + spare_refined);
  while (others.size() > always_refined && proposed[others.back()].gain < near) others.pop_back();
  propose_all(others, true, 0.0);
  std::vector<double> gains(joint_refits, 0.0);
  for (const Adopted& e : proposed) gains.push_back(e.gain);
  std::sort(gains.rbegin(), gains.rend());
  propose_all(windows, true, std::max({0.0, near, gains[joint_refits - 1]}));
  std::vector<Adopted> useful;
  for (Adopted& e : proposed)
    if (e.h != nullptr && !e.units.empty() && e.gain > 0.0) useful.push_back(std::move(e));
  std::stable_sort(useful.begin(), useful.end(),
                   [](const Adopted& a, const Adopted& b) { return a.gain > b.gain; });
  if (useful.size() > joint_refits) useful.resize(joint_refits);
  while (useful.size() > always_refined && useful.back().gain < near) useful.pop_back();
  std::vector<GapModel> models(useful.size());
  tbb::parallel_for(std::size_t{0}, useful.size(), [&](std::size_t k) {
    std::vector<Adopted> effects = base.effects;
    effects.push_back(useful[k]);
    models[k] = reassigned(evaluate(std::move(effects), base.kappa));
  });
  models = best_first(std::move(models));
  // To shape anew costs as much as to propose, so it is for those that may then be the best.
  tbb::parallel_for(std::size_t{0}, std::min(models.size(), reshaped_first),
                    [&](std::size_t k) { models[k] = reshaped(models[k]); });
  return best_first(std::move(models));
}

std::vector<GapModel> Search::best_first(std::vector<GapModel> models) const {
  // What a set makes of an effect that it already had may be no such effect any more.
  models.erase(std::remove_if(models.begin(), models.end(), [&](const GapModel& m) { return !plausible(m); }),
               models.end());
  std::stable_sort(models.begin(), models.end(),
                   [](const GapModel& a, const GapModel& b) { return a.score > b.score; });
  return models;
}

std::size_t Search::exchange(GapModel& model, std::size_t first, std::size_t last) const {
  // Few are exchanged: all are asked at once, and what comes after the first exchange is asked again.
  std::vector<std::vector<GapModel>> again(last);
  tbb::parallel_for(first, last, [&](std::size_t k) { again[k] = instead(model, k); });
  for (std::size_t k = first; k < last; ++k) {
    if (again[k].empty() || !(again[k][0].score > model.score + least_exchange)) continue;
    model = std::move(again[k][0]);
    return k;
  }
  return last;
}

GapModel Search::exchanged(GapModel model) const {
  for (bool better = true; better;) {
    const std::size_t count = model.effects.size();
    better = exchange(model, 0, count) < count;
  }
  return model;
}

bool Search::matters(const GapModel& model, const GapModel& next) const {
  if (model.effects.empty()) return true;
  const std::vector<Eigen::Index> where = outside_windows(by_.rows, model.effects);
  const auto energy = [&](const Eigen::MatrixXd& x) -> Eigen::RowVectorXd {
    return x(where, Eigen::all).colwise().squaredNorm();
  };
  const double exact = by_.criteria.form_of_exact, approximate = by_.criteria.form_of_approximate;
  Eigen::RowVectorXd part = Eigen::RowVectorXd::Constant(by_.rows.joints(), exact * exact);
  for (const Adopted& e : model.effects)
    for (const UnitShape& u : e.units)
      if (e.h->approximate() && e.h->scope() != Scope::window)
        for (const int j : u.block->channels) part[j] = approximate * approximate;
  const Eigen::RowVectorXd gained = energy(model.fit.left) - energy(next.fit.left);
  const Eigen::RowVectorXd gap = energy(by_.rows.y), noise = energy(next.fit.residual);
  return !(gained.array() < part.array() * gap.array() ||
           gained.array() < by_.criteria.least_gain * noise.array())
              .all();
}

std::vector<GapModel> Search::instead(const GapModel& model, std::size_t which) const {
  const GapModel base = evaluate(without(model.effects, which), model.kappa);
  return alternatives(base, 4, model.score - base.score);
}

GapModel Search::grown(GapModel model, int most, Trail* trail) const {
  // Whether others went on from here.
  const auto passed = [&] {
    if (trail == nullptr || model.effects.empty()) return false;
    if (trail->meets(model, by_.criteria.least_better)) return true;
    trail->add(model);
    return false;
  };
  const double kappa = model.kappa;
  if (passed()) return model;
  while (static_cast<int>(model.effects.size()) < most) {
    const std::vector<GapModel> next = alternatives(model, 8);
    if (next.empty() || next[0].score < model.score + by_.criteria.effect_gain) break;
    if (!matters(model, next[0])) break;
    model = next[0];
    // Exchange: an earlier choice may have stood in for what is known only now.
    for (std::size_t k = 0; k + 1 < model.effects.size();)
      k = exchange(model, k, model.effects.size() - 1) + 1;
    if (passed()) return model;
  }
  // Backward.
  for (std::size_t k = model.effects.size(); k-- > 0 && model.effects.size() > 1;) {
    const GapModel fewer = evaluate(without(model.effects, k), kappa);
    if (fewer.score > model.score - 0.5 * by_.criteria.effect_gain) model = fewer;
  }
  return simplified(exchanged(model));
}

}  // namespace dynid::detail
