// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dynid/retrieval/retrieval.hpp"

namespace dynid {

/// The processes that `mpirun` started, where the library was built with DYNID_WITH_MPI and there are any;
/// else this process alone. One object for the life of the program: it starts MPI, if nobody has, and ends
/// it.
class MpiRanks {
 public:
  MpiRanks();
  ~MpiRanks();  // with MPI it does something; NOLINT(performance-trivially-destructible)
  MpiRanks(const MpiRanks&) = delete;
  MpiRanks& operator=(const MpiRanks&) = delete;

  int rank() const noexcept { return rank_; }
  int ranks() const noexcept { return ranks_; }

  /// Makes retrieve(problem, options) share its runs among the ranks: every rank calls it alike and gets the
  /// same result, which is that of one process.
  void share(RetrievalOptions& options) const;
  /// Texts, of which each rank has some and empty ones for the others: every rank gets all. Every rank calls
  /// it alike.
  void gather_texts(std::vector<std::string>& texts) const;

 private:
  int rank_ = 0;
  int ranks_ = 1;
  [[maybe_unused]] bool started_ = false;  // not without MPI
};

}  // namespace dynid
