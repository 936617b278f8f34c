// SPDX-License-Identifier: Apache-2.0
#include "dynid/retrieval/mpi.hpp"

#ifdef DYNID_WITH_MPI
#include <mpi.h>

#include <cstdlib>
#include <cstring>
#endif

namespace dynid {

#ifdef DYNID_WITH_MPI

namespace {

constexpr int head = 7;  // doubles of a run before its two vectors

void pack(const RetrievalRun& run, std::vector<double>& out) {
  double seed = 0.0;  // its bits, not its value
  static_assert(sizeof(seed) == sizeof(run.seed), "a seed travels as a double");
  std::memcpy(&seed, &run.seed, sizeof(seed));
  out.insert(out.end(), {static_cast<double>(run.index), seed, run.objective, run.weighted, run.penalty,
                         run.feasible ? 1.0 : 0.0, run.seconds});
  out.insert(out.end(), run.p.data(), run.p.data() + run.p.size());
  out.insert(out.end(), run.nearest.data(), run.nearest.data() + run.nearest.size());
}

RetrievalRun unpack(const double* in, int size) {
  RetrievalRun run;
  run.index = static_cast<int>(in[0]);
  std::memcpy(&run.seed, in + 1, sizeof(run.seed));
  run.objective = in[2];
  run.weighted = in[3];
  run.penalty = in[4];
  run.feasible = in[5] != 0.0;
  run.seconds = in[6];
  run.p = Eigen::Map<const Eigen::VectorXd>(in + head, size);
  run.nearest = Eigen::Map<const Eigen::VectorXd>(in + head + size, size);
  return run;
}

void gather(RetrievalReport& report, int ranks) {
  int interrupted = report.interrupted ? 1 : 0;
  MPI_Allreduce(MPI_IN_PLACE, &interrupted, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
  int size = report.runs.empty() ? 0 : static_cast<int>(report.runs.front().p.size());
  MPI_Allreduce(MPI_IN_PLACE, &size, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
  std::vector<double> mine, all;
  for (const RetrievalRun& run : report.runs) pack(run, mine);
  const int count = static_cast<int>(mine.size());
  std::vector<int> counts(static_cast<std::size_t>(ranks)), offsets(counts.size());
  MPI_Allgather(&count, 1, MPI_INT, counts.data(), 1, MPI_INT, MPI_COMM_WORLD);
  int total = 0;
  for (std::size_t k = 0; k < counts.size(); ++k) {
    offsets[k] = total;
    total += counts[k];
  }
  all.resize(static_cast<std::size_t>(total));
  MPI_Allgatherv(mine.data(), count, MPI_DOUBLE, all.data(), counts.data(), offsets.data(), MPI_DOUBLE,
                 MPI_COMM_WORLD);
  report.runs.clear();
  report.interrupted = interrupted != 0;
  for (int at = 0; at < total; at += head + 2 * size) report.runs.push_back(unpack(all.data() + at, size));
}

}  // namespace

MpiRanks::MpiRanks() {
  int running = 0;
  MPI_Initialized(&running);
  // Started alone, outside mpirun, there is nothing to share and no need to wait for MPI's services.
  const bool launched = std::getenv("OMPI_COMM_WORLD_SIZE") != nullptr ||
                        std::getenv("PMI_SIZE") != nullptr || std::getenv("PMIX_RANK") != nullptr;
  if (running == 0) {
    if (!launched) return;
    int provided = 0;
    MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided);
    started_ = true;
  }
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks_);
}

MpiRanks::~MpiRanks() {
  if (started_) MPI_Finalize();
}

void MpiRanks::share(RetrievalOptions& options) const {
  options.rank = rank_;
  options.ranks = ranks_;
  if (ranks_ > 1) options.gather = [ranks = ranks_](RetrievalReport& report) { gather(report, ranks); };
}

void MpiRanks::gather_texts(std::vector<std::string>& texts) const {
  if (ranks_ < 2) return;
  for (std::string& text : texts) {
    // Who has it tells the others; one has it, and no more.
    int owner = text.empty() ? -1 : rank_;
    MPI_Allreduce(MPI_IN_PLACE, &owner, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
    if (owner < 0) continue;
    auto size = static_cast<unsigned long>(text.size());
    MPI_Bcast(&size, 1, MPI_UNSIGNED_LONG, owner, MPI_COMM_WORLD);
    text.resize(size);
    MPI_Bcast(text.data(), static_cast<int>(size), MPI_CHAR, owner, MPI_COMM_WORLD);
  }
}

#else

MpiRanks::MpiRanks() = default;
MpiRanks::~MpiRanks() = default;
void MpiRanks::share(RetrievalOptions&) const {}
void MpiRanks::gather_texts(std::vector<std::string>&) const {}

#endif

}  // namespace dynid
