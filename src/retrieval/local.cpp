// SPDX-License-Identifier: Apache-2.0
#include "local.hpp"

#ifndef HAVE_CSTDDEF
#define HAVE_CSTDDEF  // Ipopt's headers leave it to the caller
#endif
#include <IpIpoptApplication.hpp>
#include <IpSolveStatistics.hpp>
#include <IpTNLP.hpp>

#include <algorithm>
#include <mutex>

#include "local_problem.hpp"

namespace dynid::detail {
namespace {

using Ipopt::Index;
using Ipopt::Number;

/// LocalProblem in Ipopt's words.
class IpoptProblem : public Ipopt::TNLP {
 public:
  IpoptProblem(const Prepared& prepared, const LocalTask& task, const Eigen::VectorXd& start)
      : task_(task), problem_(prepared, task, start) {}

  const Eigen::VectorXd& x() const noexcept { return solution_; }

  bool get_nlp_info(Index& n, Index& m, Index& nnz_jac_g, Index& nnz_h_lag, IndexStyleEnum& style) override {
    n = layout().columns();
    m = layout().rows();
    nnz_jac_g = static_cast<Index>(layout().jacobian_columns().size());
    nnz_h_lag = problem_.hessian_size();
    style = C_STYLE;
    return true;
  }

  bool get_bounds_info(Index, Number* x_l, Number* x_u, Index, Number* g_l, Number* g_u) override {
    layout().column_bounds(x_l, x_u);
    std::copy(layout().row_low().begin(), layout().row_low().end(), g_l);
    std::copy(layout().row_high().begin(), layout().row_high().end(), g_u);
    return true;
  }

  bool get_starting_point(Index, bool, Number* x, bool, Number*, Number*, Index, bool, Number*) override {
    std::copy(layout().start().data(), layout().start().data() + layout().columns(), x);
    return true;
  }

  bool eval_f(Index, const Number* x, bool, Number& f) override { return problem_.objective(x, f); }
  bool eval_grad_f(Index, const Number* x, bool, Number* g) override { return problem_.gradient(x, g); }
  bool eval_g(Index, const Number* x, bool, Index, Number* g) override { return problem_.constraints(x, g); }

  bool eval_jac_g(Index, const Number* x, bool, Index, Index, Index* rows, Index* columns,
                  Number* values) override {
    if (values != nullptr) return problem_.jacobian(x, values);
    std::copy(layout().jacobian_rows().begin(), layout().jacobian_rows().end(), rows);
    std::copy(layout().jacobian_columns().begin(), layout().jacobian_columns().end(), columns);
    return true;
  }

  bool eval_h(Index, const Number* x, bool, Number factor, Index, const Number* lambda, bool, Index,
              Index* rows, Index* columns, Number* values) override {
    if (values != nullptr) return problem_.hessian(x, factor, lambda, values);
    problem_.hessian_pattern(rows, columns);
    return true;
  }

  bool intermediate_callback(Ipopt::AlgorithmMode, Index, Number, Number, Number, Number, Number, Number,
                             Number, Number, Index, const Ipopt::IpoptData*,
                             Ipopt::IpoptCalculatedQuantities*) override {
    return task_.stop == nullptr || !task_.stop->load(std::memory_order_relaxed);
  }

  void finalize_solution(Ipopt::SolverReturn, Index, const Number* x, const Number*, const Number*, Index,
                         const Number*, const Number*, Number, const Ipopt::IpoptData*,
                         Ipopt::IpoptCalculatedQuantities*) override {
    solution_ = Eigen::Map<const Eigen::VectorXd>(x, layout().unknowns());
  }

 private:
  const LocalLayout& layout() const noexcept { return problem_.layout(); }

  const LocalTask& task_;
  LocalProblem problem_;
  Eigen::VectorXd solution_;
};

void set_options(Ipopt::OptionsList& options, const Prepared& prepared) {
  options.SetIntegerValue("print_level", 0);
  options.SetStringValue("sb", "yes");
  options.SetStringValue("nlp_scaling_method", "none");
  options.SetNumericValue("bound_relax_factor", 0.0);
  options.SetNumericValue("tol", 1e-7);
  options.SetNumericValue("constr_viol_tol", 1e-10);
  options.SetNumericValue("acceptable_tol", 1e-5);
  options.SetNumericValue("acceptable_constr_viol_tol", 1e-9);
  options.SetStringValue("mu_strategy", "monotone");
  options.SetIntegerValue("max_iter", 300);
  // A user's constraint may have a kink (a norm on its axis) that the barrier draws the iterates to.
  if (!prepared.bounds().constraints.empty()) options.SetNumericValue("barrier_tol_factor", 30.0);
}

}  // namespace

LocalSolution solve_local(const Prepared& prepared, const Eigen::VectorXd& p, const LocalTask& task) {
  Ipopt::SmartPtr<IpoptProblem> nlp = new IpoptProblem(prepared, task, p);
  // MUMPS, the linear solver of Ipopt, keeps state in static variables: one solve at a time in a process.
  static std::mutex one_at_a_time;
  const std::lock_guard<std::mutex> lock(one_at_a_time);
  Ipopt::SmartPtr<Ipopt::IpoptApplication> ipopt = new Ipopt::IpoptApplication(false);
  set_options(*ipopt->Options(), prepared);
  LocalSolution solution;
  solution.p = p;
  if (ipopt->Initialize("") != Ipopt::Solve_Succeeded) return solution;
  const Ipopt::ApplicationReturnStatus status =
      ipopt->OptimizeTNLP(Ipopt::SmartPtr<Ipopt::TNLP>(GetRawPtr(nlp)));
  solution.converged = status == Ipopt::Solve_Succeeded || status == Ipopt::Solved_To_Acceptable_Level;
  if (IsValid(ipopt->Statistics())) solution.iterations = ipopt->Statistics()->IterationCount();
  if (nlp->x().size() == 0 || !nlp->x().allFinite()) return solution;
  // Rounding aside the bounds hold; the penalised problem leaves to eq. (16) what it implies.
  const Eigen::VectorXd found = prepared.to_p(nlp->x());
  if (!found.allFinite()) return solution;
  solution.p = found.cwiseMax(prepared.bounds().lower).cwiseMin(prepared.bounds().upper);
  return solution;
}

}  // namespace dynid::detail
