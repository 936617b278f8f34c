// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <vector>

#include "dynid/diagnosis/hypothesis.hpp"
#include "rows.hpp"

namespace dynid::detail {

constexpr Eigen::Index noise_order = 4;  ///< of every autoregression here

/// Noise of one joint's torque in the band: an autoregression and the variance of its innovations.
struct ChannelNoise {
  Eigen::VectorXd ar;     ///< e_t = sum_k ar_k e_{t-k-1} + innovation
  double variance = 0.0;  ///< [(N m)^2]
};

/// Columns that take part in a fit.
struct Term {
  const RowBlock* block;
  const Hypothesis* of = nullptr;                                   ///< says which coefficients can be
  bool fixed() const { return of != nullptr && of->shape_only(); }  ///< its coefficients are 1
};

/// A fit by generalised least squares with autoregressive errors found along with it, the nominal model's
/// relative errors (standard deviation kappa) being integrated out.
struct Fit {
  Eigen::VectorXd theta;            ///< coefficients of the terms that are not fixed, one after the other
  Eigen::MatrixXd left;             ///< rows x n: the gap without the terms
  Eigen::MatrixXd residual;         ///< rows x n: and without what the nominal model's errors explain
  std::vector<ChannelNoise> noise;  ///< of each joint
  Eigen::VectorXd evidence;         ///< of each joint: log marginal likelihood, coefficients at their best
  double total = 0.0;               ///< sum of `evidence`
};

/// One joint alone.
struct ChannelFit {
  Eigen::VectorXd theta;
  ChannelNoise noise;
  Eigen::VectorXd residual;
  double evidence = 0.0;
};

/// A fit's log evidence with a form error that its noise does not know: `size` and `innovation` (n each)
/// [(N m)^2], the variance that it adds to the residual and, through the noise's filter, to the innovations.
double evidence_with_form(const GapRows& rows, const Fit& fit, const Eigen::VectorXd& size,
                          const Eigen::VectorXd& innovation);

/// A joint's noise and what the nominal model's errors look like through it: what every fit by that noise
/// shares.
struct Whitener {
  ChannelNoise noise;
  Eigen::MatrixXd nuisance;         ///< whitened
  Eigen::LLT<Eigen::MatrixXd> llt;  ///< of I + nuisance^T nuisance
  double log_det = 0.0;
};
Whitener whitener(const GapRows& rows, int joint, const ChannelNoise& noise, double kappa);

/// A joint's gap and columns as a given noise sees them: what all fits of them and a few more columns share.
struct SeenChannel {
  Whitener by;
  Eigen::MatrixXd white;  ///< [columns | y] whitened
  Eigen::MatrixXd taken;  ///< (I + N^T N)^-1 N^T white, N the whitened nuisance
  Eigen::MatrixXd gram;   ///< white^T white - (N^T white)^T taken
};
/// `y`: rows; `columns`: rows x p, p may be 0.
SeenChannel seen(const GapRows& rows, const Eigen::VectorXd& y, const Eigen::MatrixXd& columns, Whitener by);
/// The noise that a fit starts from: white, as large as the gap.
ChannelNoise white(const Eigen::VectorXd& y);

/// `y` (rows) of joint j against `columns` (rows x p, p may be 0).
ChannelFit fit_channel(const GapRows& rows, int joint, const Eigen::VectorXd& y,
                       const Eigen::MatrixXd& columns, double kappa);
/// `y` and `columns` with one more block of an effect (null: without), by the better of some given noises,
/// each taken once: quick, for comparing many. `base`: y and columns as each of them sees them.
ChannelFit fit_channel(const GapRows& rows, int joint, const Eigen::VectorXd& y,
                       const Eigen::MatrixXd& columns, const Term& more, double kappa,
                       const std::vector<SeenChannel>& base);

/// Log evidence that a block would bring to a joint's gap and columns if the given noise, the better of some,
/// were a matter of size alone: quicker, for finding the shapes that are worth a fit.
double quick_gain(const GapRows& rows, int joint, const Term& more, const std::vector<SeenChannel>& base);

/// `y` less the columns `fixed` against the columns `free` (both: which of `columns`), by the better of the
/// given noises: quick, for trying many subsets.
ChannelFit fit_subset(const GapRows& rows, int joint, const Eigen::VectorXd& y,
                      const Eigen::MatrixXd& columns, const std::vector<Eigen::Index>& free,
                      const std::vector<Eigen::Index>& fixed, double kappa,
                      const std::vector<SeenChannel>& base);

/// All joints together. `y`: rows x n.
Fit fit_terms(const GapRows& rows, const Eigen::MatrixXd& y, const std::vector<Term>& terms, double kappa);

/// Terms put together: each joint's gap less what is fixed, its columns, and where they stand among all.
struct Assembled {
  Eigen::MatrixXd y;                             ///< rows x n
  std::vector<Eigen::MatrixXd> columns;          ///< of each joint
  std::vector<std::vector<Eigen::Index>> where;  ///< of each joint's columns: the coefficient
  std::vector<Term> free;
  Eigen::Index size = 0;  ///< coefficients
};
/// Terms that many fits begin with, by some given noises.
struct SeenTerms {
  Assembled terms;
  std::vector<std::vector<SeenChannel>> by;  ///< of each noise, of each joint
  std::vector<Eigen::MatrixXd> gram;         ///< of each noise: the terms' normal equations [G | h]
};
/// `by`: of each noise one a joint.
SeenTerms seen(const GapRows& rows, const std::vector<Term>& terms,
               const std::vector<std::vector<Whitener>>& by);
/// These terms and some more, by the better of the noises, each taken once. The coefficients of `more` come
/// last.
Fit fit_terms(const GapRows& rows, const SeenTerms& base, const std::vector<Term>& more, double kappa);

/// G^-1 h of normal equations, scaled to a unit diagonal; `covariance`: G^-1, where it is not null.
Eigen::VectorXd solve(Eigen::MatrixXd G, const Eigen::VectorXd& h, Eigen::MatrixXd* covariance);

/// The normal equations [G | h] (p x (p + 1)) of one more block's coefficients, by each of the noises, with
/// those of the base's terms profiled out. A column that the base's terms contain takes next to nothing.
std::vector<Eigen::MatrixXd> normal_equations_beside(const GapRows& rows, const SeenTerms& base,
                                                     const RowBlock& more);

/// Information (inverse covariance, where there is one) of the coefficients of those terms that are not
/// fixed, beside the nominal model's errors, in the noise that a fit has left (of each joint).
Eigen::MatrixXd information_of(const GapRows& rows, const std::vector<Term>& terms,
                               const std::vector<ChannelNoise>& noise, double kappa);

/// Covariance of the coefficients of those terms that are not fixed, beside the nominal model's errors, in
/// the noise that a fit has left (of each joint): what the fit's own last step took for noise may be far
/// larger.
Eigen::MatrixXd covariance_of(const GapRows& rows, const std::vector<Term>& terms,
                              const std::vector<ChannelNoise>& noise, double kappa);

/// What those coefficients become where `more` (rows x n) is added to the gap, in the same noise.
Eigen::VectorXd answer_to(const GapRows& rows, const std::vector<Term>& terms, const Eigen::MatrixXd& more,
                          const std::vector<ChannelNoise>& noise, double kappa);

/// `x` (rows x columns) whitened by the noise, in units of its standard deviation; the first rows of every
/// part, which have no past, are left out.
Eigen::MatrixXd whitened(const GapRows& rows, const Eigen::MatrixXd& x, const ChannelNoise& noise);
/// The adjoint of whitened(): w^T whitened(x) is whitened_back(w)^T x.
Eigen::MatrixXd whitened_back(const GapRows& rows, const Eigen::MatrixXd& w, const ChannelNoise& noise);

}  // namespace dynid::detail
