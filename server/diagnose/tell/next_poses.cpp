#include "server/diagnose/tell/next_poses.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "server/base/check.h"
#include "server/diagnose/families/candidates.h"
#include "server/diagnose/thresholds.h"
#include "server/plan/approach.h"
#include "server/plan/plan.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kPool = 600;       // poses to choose from
constexpr int kRounds = 3;       // of moving the poses chosen; a fourth changes little
constexpr int kVariants = 40;    // of each pose, in a round
constexpr int kRandomSets = 20;  // of poses, to compare with on average

/// A cause as a member of its family.
struct Member {
  const Family* family = nullptr;
  Best best;
  bool begins = false;  ///< it begins at a pose: all later measurements lie after it
};

/// The index of a pose in a batch, 0 if it has no pose of that name.
Index index_of(const MeasurementBatch& batch, const std::string& pose_id) {
  const auto& all = batch.measurements;
  const auto found = std::find_if(all.begin(), all.end(),
                                  [&](const Measurement& m) { return m.pose_id == pose_id; });
  return found == all.end() ? 0 : found - all.begin();
}

/// `cause` among the families of `problem`; its size and length scale as the data have them.
std::optional<Member> member_of(const LinearProblem& problem,
                                const std::vector<FamilyPtr>& families,
                                const Background& background, const Cause& cause) {
  for (const FamilyPtr& family : families) {
    if (!family->named() || !family->predicts()) continue;
    const Cause one = family->cause(family->typical());
    if (one.cause != cause.cause || one.joint != cause.joint || one.parameter != cause.parameter)
      continue;
    Member member{family.get(),
                  family->scan({background}, background.project(problem.residual())).front(),
                  !cause.pose_id.empty()};
    if (!(member.best.evidence > 0)) member.best = family->typical();
    if (cause.order) member.best.order = *cause.order;
    if (member.begins) member.best.pose = index_of(problem.batch(), cause.pose_id);
    return member;
  }
  return std::nullopt;
}

/// Columns of everything that is free when a finding is doubted: the model's parameters, the
/// rivals, and last the finding itself.
struct Doubted {
  MatrixXd columns;
  Index own = 0;  // the last ones
};
Doubted doubted(const LinearProblem& problem, const std::vector<Member>& members) {
  Doubted all{problem.nuisance(), 0};
  for (const Member& member : members) {
    const MatrixXd block = member.family->columns(member.best);
    all.own = block.cols();
    all.columns.conservativeResize(Eigen::NoChange, all.columns.cols() + all.own);
    all.columns.rightCols(all.own) = block;
  }
  return all;
}

/// The causes of `members` among the families of poses that are measured afterwards.
std::vector<Member> afterwards(const std::vector<Member>& members,
                               const std::vector<FamilyPtr>& families) {
  std::vector<Member> later;
  for (const Member& member : members) {
    const auto same = std::find_if(families.begin(), families.end(), [&](const FamilyPtr& family) {
      return family->label() == member.family->label();
    });
    if (same == families.end()) return {};
    later.push_back({same->get(), member.best, member.begins});
    if (member.begins) later.back().best.pose = 0;
  }
  return later;
}

/// The uncertainty of the finding's effect over the poses measured, in shares of its size, and how
/// more poses lower it.
class Uncertainty {
 public:
  Uncertainty(const Doubted& doubted, MatrixXd weight)
      : weight_(std::move(weight)), own_(doubted.own) {
    const Index P = doubted.columns.cols();
    information_ = doubted.columns.transpose() * doubted.columns + MatrixXd::Identity(P, P);
    covariance_ = information_.llt().solve(MatrixXd::Identity(P, P));
  }
  double variance() const { return (covariance_.bottomRightCorner(own_, own_) * weight_).trace(); }
  double variance_with(const MatrixXd& rows) const {
    const MatrixXd gain = covariance_.bottomRows(own_) * rows.transpose();
    const MatrixXd innovation =
        rows * covariance_ * rows.transpose() + MatrixXd::Identity(rows.rows(), rows.rows());
    return variance() - (gain * innovation.llt().solve(gain.transpose()) * weight_).trace();
  }
  void add(const MatrixXd& rows) {
    information_ += rows.transpose() * rows;
    covariance_ =
        information_.llt().solve(MatrixXd::Identity(information_.rows(), information_.rows()));
  }

 private:
  MatrixXd weight_, information_, covariance_;
  Index own_;
};

struct Candidate {
  JointVector q;
  MatrixXd rows;  // the rows that it would measure, for all free columns
};
using Candidates = std::vector<Candidate>;

/// The poses that could be measured next.
class Measuring {
 public:
  /// `columns`: how many the members and the model's parameters have together.
  Measuring(const SearchResult& found, const std::vector<Member>& members, Index columns,
            std::uint64_t seed)
      : found_(found), members_(members), columns_(columns), random_(seed), seed_(seed) {}

  /// Evenly over the cell's ranges.
  Result<Candidates> pool() {
    const MatrixXd planned = TRY(plan_poses(cell(), {.count = kPool, .seed = seed_}));
    return measurable(planned);
  }
  /// `chosen` with one or two joints elsewhere: anywhere in their ranges, or as near to an end as
  /// they can be approached.
  Candidates variants(const JointVector& chosen) {
    const Result<JointRanges> ranges = planning_ranges(cell());
    if (!ranges) return {};
    std::uniform_real_distribution<double> place(-0.3, 1.3);
    std::uniform_int_distribution<Index> joint(0, chosen.size() - 1);
    MatrixXd all = chosen.transpose().replicate(kVariants, 1);
    for (Index i = 0; i < all.rows(); ++i) {
      for (Index moved = 0; moved <= i % 2; ++moved) {
        const Index j = joint(random_);
        const auto& range = (*ranges)[static_cast<std::size_t>(j)];
        const auto [lower, upper] =
            approachable_range(cell().robot.joint(static_cast<int>(j)), range.first, range.second);
        all(i, j) = lower + std::clamp(place(random_), 0.0, 1.0) * (upper - lower);
      }
    }
    return measurable(all);
  }

 private:
  /// The candidates that a plan accepts, in their written form: on the grid of programs, with room
  /// for an approach.
  Candidates measurable(MatrixXd all) {
    for (Index i = 0; i < all.rows(); ++i)
      all.row(i) = on_program_grid(cell().robot, all.row(i).transpose());
    const Result<std::vector<bool>> may = plannable(cell(), all);
    std::vector<Index> kept;
    for (Index i = 0; may && i < all.rows(); ++i) {
      if ((*may)[static_cast<std::size_t>(i)]) kept.push_back(i);
    }
    if (kept.empty()) return {};
    return seen(all(kept, Eigen::all));
  }

  const Cell& cell() const { return *found_.before.model.cell; }

  /// The candidates as measurements at the model's predicted poses. They continue the batch in its
  /// context.
  Candidates seen(const MatrixXd& q) {
    MeasurementBatch batch;
    batch.id = "next";
    const auto& done = found_.all.measurements;
    for (Index i = 0; i < q.rows(); ++i) {
      const Measurement& like = done[static_cast<std::size_t>(i) % done.size()];
      Measurement m;
      m.context = like.context;
      m.context.q = q.row(i).transpose();
      m.context.velocity.reset();
      m.context.before.reset();
      for (int& direction : m.context.direction) direction = random_() % 2 == 0 ? 1 : -1;
      m.context.index = static_cast<int>(done.size() + static_cast<std::size_t>(i));
      const Pose X_WT = found_.before.model.pose_W(m.context);
      m.p_W = X_WT.translation();
      if (like.R_WT) m.R_WT = X_WT.linear();
      batch.measurements.push_back(std::move(m));
    }
    const LinearProblem problem(found_.before.model, batch, found_.before.priors,
                                candidate_sources(cell(), found_.all, nullptr));
    const std::vector<FamilyPtr> families = make_families(problem);
    const std::vector<Member> later = afterwards(members_, families);
    if (later.empty()) return {};
    const MatrixXd columns = doubted(problem, later).columns;
    TRAMMEL_CHECK(columns.cols() == columns_);
    Candidates all;
    for (Index i = 0; i < q.rows(); ++i)
      all.push_back(
          {q.row(i).transpose(), columns.middleRows(problem.first_row(i), problem.row_count(i))});
    return all;
  }

  const SearchResult& found_;
  const std::vector<Member>& members_;
  Index columns_;
  std::mt19937_64 random_;
  std::uint64_t seed_;
};

/// The one of `candidates` that lowers the uncertainty most.
std::size_t best_of(const Candidates& candidates, const Uncertainty& uncertainty) {
  std::size_t best = 0;
  double lowest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const double variance = uncertainty.variance_with(candidates[i].rows);
    if (variance >= lowest) continue;
    lowest = variance;
    best = i;
  }
  return best;
}

Uncertainty with(Uncertainty uncertainty, const Candidates& measured) {
  for (const Candidate& one : measured) uncertainty.add(one.rows);
  return uncertainty;
}

/// `count` of `pool`, one after the other.
Candidates chosen_from(Candidates pool, int count, Uncertainty uncertainty) {
  Candidates chosen;
  while (static_cast<int>(chosen.size()) < count && !pool.empty()) {
    const std::size_t best = best_of(pool, uncertainty);
    uncertainty.add(pool[best].rows);
    chosen.push_back(std::move(pool[best]));
    pool.erase(pool.begin() + static_cast<std::ptrdiff_t>(best));
  }
  return chosen;
}

/// Replaces each pose in turn by a variant that gives more information beside the others.
void move(Candidates& chosen, Measuring& measuring, const Uncertainty& now) {
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    Candidates others = chosen;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    Candidates variants = measuring.variants(chosen[k].q);
    variants.push_back(chosen[k]);
    chosen[k] = variants[best_of(variants, with(now, others))];
  }
}

/// Standard deviation with as many random ones of the pool, on average.
double stddev_with_random(Candidates pool, std::size_t count, const Uncertainty& now,
                          std::uint64_t seed) {
  std::mt19937_64 random(seed);
  double sum = 0;
  for (int set = 0; set < kRandomSets; ++set) {
    std::shuffle(pool.begin(), pool.end(), random);
    const auto some = pool.begin() + static_cast<std::ptrdiff_t>(std::min(count, pool.size()));
    sum += std::sqrt(with(now, {pool.begin(), some}).variance());
  }
  return sum / kRandomSets;
}

}  // namespace

NextPoses next_poses_for(const SearchResult& found, const LinearProblem& before,
                         const DiagnoseOptions& options) {
  const auto finding = std::find_if(found.accepted.begin(), found.accepted.end(),
                                    [](const Accepted& one) { return !one.could_also_be.empty(); });
  if (finding == found.accepted.end() || options.next_poses <= 0) return {};
  const std::vector<FamilyPtr> families = make_families(before);
  const Background background(background_columns(before, {}));
  std::vector<Member> members;
  bool free = false;  // a rival is among the model's own numbers
  for (const Cause& rival : finding->could_also_be) {
    const std::optional<Member> member = member_of(before, families, background, rival);
    if (member) members.push_back(*member);
    free = free || has_cause(before.model(), rival);
  }
  const std::optional<Member> itself = member_of(before, families, background, finding->cause);
  if ((members.empty() && !free) || !itself) return {};
  members.push_back(*itself);
  const Doubted doubt = doubted(before, members);
  Measuring measuring(found, members, doubt.columns.cols(), options.seed);
  const Result<Candidates> pool = measuring.pool();
  if (!pool || pool->empty()) return {};

  const MatrixXd own = doubt.columns.rightCols(doubt.own);
  const MatrixXd information = own.transpose() * own + MatrixXd::Identity(doubt.own, doubt.own);
  const VectorXd fitted = information.llt().solve(own.transpose() * before.residual());
  const double size = std::max(1e-12, (own * fitted).norm());
  const Uncertainty now(doubt, own.transpose() * own / (size * size));
  Candidates chosen = chosen_from(*pool, options.next_poses, now);
  for (int round = 0; round < kRounds; ++round) move(chosen, measuring, now);

  NextPoses next;
  next.separates = {finding->cause};
  next.separates.insert(next.separates.end(), finding->could_also_be.begin(),
                        finding->could_also_be.end());
  next.stddev_now = std::sqrt(now.variance());
  next.stddev_expected = std::sqrt(with(now, chosen).variance());
  // If no pose distinguishes the causes, another measurement is needed, which the finding's action
  // names.
  if (next.stddev_expected > thresholds::kWorthMeasuring * next.stddev_now) return {};
  for (const Candidate& one : chosen) next.q.push_back(one.q);
  next.stddev_random = stddev_with_random(*pool, chosen.size(), now, options.seed);
  return next;
}

}  // namespace trammel::cause_search
