// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "dynid/diagnosis/diagnose.hpp"
#include "propose.hpp"

namespace dynid::detail {

/// The sets that a search came through.
class Trail {
 public:
  void add(const GapModel& model) { sets_.push_back(set_of(model)); }
  /// The same effects on the same units, as good within `enough` [nat].
  bool meets(const GapModel& model, double enough) const;

 private:
  struct Set {
    std::set<std::pair<const Hypothesis*, int>> units;
    double kappa, score;
  };
  static Set set_of(const GapModel& model);
  std::vector<Set> sets_;
};

/// Finds effects in the rows of a gap: steps 5 and 7 of the method.
class Search {
 public:
  /// `library`: what may be found. Columns of every grid point are computed here, on all cores. Holds a
  /// reference to the rows and to the criteria.
  Search(const GapRows& rows, std::vector<const Hypothesis*> library, const Criteria& criteria);
  /// What `proposer` finds in a spread of windows, evaluated on `rows`: it has no grids of its own. Holds a
  /// reference to the proposer too.
  Search(const GapRows& rows, const Search& proposer);

  /// The best set of up to `most` effects, by forward steps with joint refits, exchanges and a backward
  /// check, for a nominal model whose parameters are off by `kappa`, relatively.
  GapModel best(double kappa, int most) const { return grown(none(kappa), most); }
  /// The same from a set that is likely to be near it. `trail`: what other searches came through, to which
  /// this one adds its own; one that comes to a set on it goes the same way from there, and ends.
  GapModel grown(GapModel model, int most, Trail* trail = nullptr) const;
  /// The set with one effect after another in exchange for a better one, until none is better.
  GapModel exchanged(GapModel model) const;
  /// The gap with no effect.
  GapModel none(double kappa) const { return evaluate({}, kappa); }
  /// A set refitted, from whichever rows it comes.
  GapModel moved_here(const std::vector<Adopted>& effects, double kappa) const {
    return by_.evaluate(by_.here(effects), kappa);
  }
  /// A set refitted.
  GapModel evaluate(std::vector<Adopted> effects, double kappa) const {
    return by_.evaluate(std::move(effects), kappa);
  }
  /// Whether coefficients and shapes can be those of such effects, on these joints and logs.
  bool plausible(const GapModel& model) const { return by_.plausible(model); }
  /// And of one unit of one effect.
  bool plausible(const Hypothesis& h, int unit, const Eigen::VectorXd& c,
                 const Eigen::VectorXd& shape) const {
    return by_.plausible(h, unit, c, shape);
  }
  /// What an effect costs of the score, whatever its size.
  double cost(const Adopted& effect) const { return by_.cost(effect); }
  /// The best form of every effect on top of a model (which may be none()), best first: each refitted jointly
  /// with it. `worth`: log evidence that an effect has to bring to be of interest; those that are far from it
  /// on their grids are left out, but for the best two.
  std::vector<GapModel> alternatives(const GapModel& base, std::size_t joint_refits,
                                     double worth = 0.0) const;
  /// Of each effect with one coefficient on a joint of its own: the torque that it would have had to have to
  /// be named, on the joint that shows it least.
  std::vector<VisibleSize> smallest_visible(const GapModel& none) const;
  /// Columns of every point of every effect's grid.
  std::vector<const RowBlock*> blocks() const;
  std::vector<std::string> names() const;  ///< of the library's effects; repeated where one has several forms
  /// Lets go of the grids and columns, which are most of a diagnosis' memory: nothing is sought any more.
  void end() {
    by_.forget();
    grids_ = std::vector<Grid>(library_.size());
    answers_ = std::make_unique<Answers>();
  }
  const GapRows& rows() const { return by_.rows; }
  const Robot& robot() const { return by_.robot(); }  ///< the nominal model
  const Criteria& criteria() const { return by_.criteria; }

 private:
  /// A further effect has to matter beside those before it, on one joint at least; beside a window, where
  /// that is not.
  bool matters(const GapModel& model, const GapModel& next) const;
  /// Which joint has which of the model's own effects, each joint decided by itself: an effect that came
  /// first may have taken joints of one that came later.
  GapModel reassigned(const GapModel& model) const;
  /// The model with its own effects shaped anew on the joints of the newest one: what came first was shaped
  /// to stand in for what came later as well.
  GapModel reshaped(const GapModel& model) const;
  /// The model with a simpler effect beside one that contains it, on the joints that ask for no more: what
  /// all joints have (Coulomb friction) is not to take the name of what some have (asymmetric Coulomb
  /// friction).
  GapModel simplified(GapModel model) const;
  /// Of the model's own effects `own`, the form that each has on a joint, or would have there by itself; none
  /// where the joint has none of them.
  std::vector<UnitShape> forms_on(const GapModel& model, const std::vector<std::size_t>& own, int joint,
                                  const Channel& alone) const;

  /// The alternatives of the proposer, on these rows.
  std::vector<GapModel> proposed_elsewhere(const GapModel& base, std::size_t joint_refits,
                                           double worth) const;

  /// Those that can be, best first.
  std::vector<GapModel> best_first(std::vector<GapModel> models) const;

  /// What may take the place of an effect of a model, best first.
  std::vector<GapModel> instead(const GapModel& model, std::size_t which) const;

  /// Exchanges the first of the effects `first` to `last` (not included) for which there is a better one:
  /// which one, or `last`.
  std::size_t exchange(GapModel& model, std::size_t first, std::size_t last) const;

  /// What alternatives() said last, by effects, units, shapes, kappa, refits and worth: an exchange asks
  /// again for what the one before it was told. Neither its limit nor the order of threads changes a result.
  using Asked = std::pair<std::vector<const Hypothesis*>, std::vector<double>>;
  struct Answers {
    std::mutex mutex;
    std::map<Asked, std::vector<GapModel>> known;
    std::deque<Asked> order;
  };
  std::vector<GapModel> alternatives_anew(const GapModel& base, std::size_t joint_refits, double worth) const;

  const Search* proposer_ = nullptr;
  Evaluator by_;
  std::vector<const Hypothesis*> library_;
  std::vector<Grid> grids_;
  std::unique_ptr<Answers> answers_ = std::make_unique<Answers>();
};

}  // namespace dynid::detail
