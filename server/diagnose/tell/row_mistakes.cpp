#include "server/diagnose/tell/row_mistakes.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "server/diagnose/evidence/effect.h"
#include "server/diagnose/thresholds.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t kMostIds = 40;  // most ids in a sentence
constexpr int kMostRounds = 20;  // alternating between sides and play: each round lowers the misfit

std::string listed(std::vector<std::string> ids) {
  const std::size_t more = ids.size() - std::min(ids.size(), kMostIds);
  ids.resize(ids.size() - more);
  return fmt::format("{}{}", fmt::join(ids, ", "),
                     more > 0 ? fmt::format(" and {} more", more) : "");
}

/// The other readings that single poses would fit.
class Misread {
 public:
  explicit Misread(const Explained& explained)
      : model_(explained.after.model()),
        noise_(explained.after.noise()),
        all_(explained.found.all.measurements) {
    for (const Accepted& one : explained.found.accepted) {
      if (one.is_outlier()) out_.push_back(measured_at(one.pose));
    }
    std::erase(out_, nullptr);
  }

  /// The mistake of that pose, for people; empty if none is known.
  [[nodiscard]] std::string reason(const SuspectedPose& pose) {
    const Measurement* m = measured_at(pose);
    if (m == nullptr) return "";
    std::string text = as_other_tool(*m);
    if (text.empty()) text = as_other_payload(*m);
    if (text.empty()) text = from_other_side(*m);
    if (text.empty()) text = as_other_row(*m);
    return text;
  }
  /// Pose ids by the mistake found in them, `poses that ...`.
  [[nodiscard]] const std::map<std::string, std::vector<std::string>>& groups() const {
    return groups_;
  }

 private:
  [[nodiscard]] const Measurement* measured_at(const SuspectedPose& pose) const {
    const auto found = std::find_if(all_.begin(), all_.end(), [&](const Measurement& m) {
      return m.row == pose.row && m.pose_id == pose.pose_id;
    });
    return found == all_.end() ? nullptr : &*found;
  }
  [[nodiscard]] double distance(const Measurement& m, const PoseContext& context) const {
    return (m.p_W - model_.pose_W(context).translation()).norm();
  }
  /// True if `m` fits that context far better than its own.
  [[nodiscard]] bool fits(const Measurement& m, const PoseContext& context) const {
    const double other = distance(m, context);
    return other < thresholds::kFitsOtherwise * noise_ &&
           other < thresholds::kFitsBetter * distance(m, m.context);
  }
  std::string noted(const std::string& group, const Measurement& m, std::string reason) {
    groups_[group].push_back(m.pose_id);
    return reason;
  }
  std::string as_other_tool(const Measurement& m) {
    for (const auto& [id, X_FT] : model_.tools) {
      PoseContext context = m.context;
      context.tool = id;
      if (id != m.context.tool && fits(m, context))
        return noted(fmt::format("poses that fit tool '{}' and not their tool_id", id), m,
                     fmt::format("fits tool '{}': is its tool_id wrong?", id));
    }
    return "";
  }
  std::string as_other_payload(const Measurement& m) {
    for (const auto& [id, payload] : model_.cell->payloads) {
      PoseContext context = m.context;
      context.payload = id;
      if (id != m.context.payload && fits(m, context))
        return noted(fmt::format("poses that fit payload '{}' and not their payload_id", id), m,
                     fmt::format("fits payload '{}': is its payload_id wrong?", id));
    }
    return "";
  }
  std::string from_other_side(const Measurement& m) {
    for (std::size_t j = 0; j < m.context.direction.size(); ++j) {
      PoseContext context = m.context;
      context.direction[j] = -context.direction[j];
      if (fits(m, context))
        return noted(fmt::format("poses that came from the other side than dir{} says", j + 1), m,
                     fmt::format("came from the other side of joint {0} than dir{0} says", j + 1));
    }
    return "";
  }
  /// Measured with the joints of another row that fits nothing itself, or of any other row.
  std::string as_other_row(const Measurement& m) {
    const auto has_joints_of = [&](const Measurement& other) {
      PoseContext context = m.context;
      context.q = other.context.q;
      return other.row != m.row && fits(m, context);
    };
    for (const Measurement* other : out_) {
      if (has_joints_of(*other))
        return noted(
            "poses that were measured with the joints of another row", m,
            fmt::format("was measured with the joints of row {} ({}): were rows exchanged?",
                        other->row, other->pose_id));
    }
    const auto other = std::find_if(all_.begin(), all_.end(), has_joints_of);
    if (other == all_.end()) return "";
    return noted(
        "poses that were measured with the joints of another row", m,
        fmt::format("was measured with the joints of row {} ({}): was it copied or shifted?",
                    other->row, other->pose_id));
  }

  const PhysicalModel& model_;
  double noise_;  // m per axis
  const std::vector<Measurement>& all_;
  std::vector<const Measurement*> out_;
  std::map<std::string, std::vector<std::string>> groups_;
};

/// Sides of approach: +1 as marked, -1 from the other side. The fit finds them together with the
/// resulting play.
class Sides {
 public:
  Sides(const LinearProblem& problem, const Background& all, const std::string& source)
      : problem_(problem), side_(VectorXd::Ones(problem.poses())) {
    const std::vector<Index> own = places_of_source(problem.model(), source);
    std::vector<Index> others;
    for (Index k = 0; k < all.columns().cols(); ++k) {
      if (std::find(own.begin(), own.end(), k) == own.end()) others.push_back(k);
    }
    marked_ = all.columns()(Eigen::all, own);
    data_ = problem.residual() + effect_of_source(problem, source);
    const Background beside = all.part(others);
    for (int round = 0; round < kMostRounds; ++round) {
      fit(beside);
      if (!turn_sides()) break;
    }
  }
  /// Places of the poses that came from the other side, beyond doubt; none where more than half
  /// did, which is the sign of all marks.
  [[nodiscard]] std::vector<Index> marked_wrongly() const {
    std::vector<Index> wrong;
    const double noise = left_.squaredNorm() / static_cast<double>(left_.size());
    for (Index i = 0; i < problem_.poses(); ++i) {
      const auto [way, along] = of_pose(i);
      const bool shows = way > std::pow(thresholds::kShowsItsSide, 2) * noise;
      if (side_(i) < 0 && shows && 2 * along > thresholds::kSureOfSide * noise) wrong.push_back(i);
    }
    if (2 * wrong.size() > static_cast<std::size_t>(problem_.poses())) wrong.clear();
    return wrong;
  }

 private:
  void fit(const Background& beside) {
    MatrixXd columns = marked_;
    for (Index i = 0; i < problem_.poses(); ++i)
      columns.middleRows(problem_.first_row(i), problem_.row_count(i)) *= side_(i);
    MatrixXd information = columns.transpose() * beside.project(columns);
    information.diagonal().array() += 1;
    play_ = columns * information.llt().solve(columns.transpose() * beside.project(data_));
    const VectorXd rest = data_ - play_;
    left_ = rest - beside.columns() * beside.estimate(rest);
  }
  /// The play at a pose as recorded: its square, and the component of the data along it.
  [[nodiscard]] std::pair<double, double> of_pose(Index i) const {
    const auto play = play_.segment(problem_.first_row(i), problem_.row_count(i));
    const auto left = left_.segment(problem_.first_row(i), problem_.row_count(i));
    return {play.squaredNorm(), play.dot(left + play)};
  }
  bool turn_sides() {
    bool turned = false;
    for (Index i = 0; i < problem_.poses(); ++i) {
      if (of_pose(i).second >= 0) continue;
      side_(i) = -side_(i);
      turned = true;
    }
    return turned;
  }

  const LinearProblem& problem_;
  VectorXd side_;
  MatrixXd marked_;
  VectorXd data_, play_, left_;
};

/// True if the tool of `m` was found where tool `other` is, though the cell has them apart.
bool are_one(const Explained& explained, const Measurement& m, const std::string& other) {
  const auto apart = [&](const PhysicalModel& model) {
    PoseContext context = m.context;
    context.tool = other;
    return (model.pose_W(context).translation() - model.pose_W(m.context).translation()).norm();
  };
  const double after = apart(explained.after.model());
  return after < thresholds::kFitsOtherwise * explained.after.noise() &&
         after < thresholds::kFitsBetter * apart(explained.found.before.model);
}

/// Marks the findings of `record` at that joint as doubtful.
void doubt(Diagnosis& diagnosis, const CauseRecord& record, const Cause& rival,
           const std::string& action) {
  for (Finding& finding : diagnosis.findings) {
    if (&record_of(finding.cause) != &record || finding.cause.joint != rival.joint) continue;
    auto& others = finding.could_also_be;
    if (std::find(others.begin(), others.end(), rival) == others.end()) others.push_back(rival);
    finding.whole = true;  // a mistake enters no model, not even as the best known shape
    finding.action = action;
  }
  if (diagnosis.verdict == Verdict::kNamed) diagnosis.verdict = Verdict::kAmbiguous;
}

void tell_wrong_sides(const Explained& explained, Diagnosis& diagnosis) {
  const LinearProblem& problem = explained.after;
  for (const Accepted& one : explained.found.accepted) {
    if (record_of(one.cause).search != causes::SearchFamily::kPlay) continue;
    const std::vector<Index> wrong = Sides(problem, explained.all, one.in_model).marked_wrongly();
    if (wrong.empty()) continue;
    const int joint = one.cause.joint + 1;
    std::vector<std::string> ids;
    for (const Index i : wrong) {
      const Measurement& m = problem.batch().measurements[static_cast<std::size_t>(i)];
      ids.push_back(m.pose_id);
      diagnosis.suspects.push_back(
          {.pose_id = m.pose_id,
           .row = m.row,
           .distance = problem.positions(problem.residual()).col(i).norm(),
           .reason =
               fmt::format("came from the other side of joint {} than dir{} says", joint, joint)});
    }
    const std::string what =
        fmt::format("{} of {} poses came from the other side of joint {} than dir{} says",
                    wrong.size(), problem.poses(), joint, joint);
    diagnosis.limits.push_back(fmt::format("{}: {}", what, listed(std::move(ids))));
    doubt(diagnosis, record_of(one.cause), unknown_cause(one.cause.joint),
          what +
              ": correct the marks and diagnose again, for the size of the play is not to be "
              "trusted");
  }
}

/// Reports tools that are two in the cell but equal by the findings: then the rows of the rarer one
/// may have the wrong name.
void tell_tools_that_are_one(const Explained& explained, Diagnosis& diagnosis) {
  const auto& rows = explained.found.batch.measurements;
  std::map<std::string, std::vector<const Measurement*>> by_tool;
  for (const Measurement& m : rows) by_tool[m.context.tool].push_back(&m);
  for (const auto& [rare, own] : by_tool) {
    for (const auto& [usual, others] : by_tool) {
      if (own.size() >= others.size() || !are_one(explained, *own.front(), usual)) continue;
      std::vector<std::string> ids;
      for (const Measurement* m : own) {
        ids.push_back(m->pose_id);
        diagnosis.suspects.push_back(
            {.pose_id = m->pose_id,
             .row = m->row,
             .reason = fmt::format("fits tool '{}': is its tool_id wrong?", usual)});
      }
      diagnosis.limits.push_back(
          fmt::format("tool '{}' is found where tool '{}' is: are these tool_ids wrong? {}", rare,
                      usual, listed(ids)));
      doubt(diagnosis, cause_correcting(causes::Part::kTool), unknown_cause(),
            fmt::format("see whether the rows of tool '{}' were measured with '{}'", rare, usual));
    }
  }
}

void tell_times(const MeasurementBatch& recorded, Diagnosis& diagnosis) {
  const std::vector<std::size_t> against = rows_against_time(recorded);
  const auto& rows = recorded.measurements;
  if (against.empty() || static_cast<double>(against.size()) >
                             thresholds::kMostOutliers * static_cast<double>(rows.size()))
    return;
  std::vector<std::string> ids;
  for (const std::size_t i : against) {
    ids.push_back(rows[i].pose_id);
    diagnosis.suspects.push_back(
        {.pose_id = rows[i].pose_id,
         .row = rows[i].row,
         .reason = "its time_s falls behind the row before, or runs ahead of the next"});
  }
  diagnosis.limits.push_back(
      fmt::format("time_s does not rise at {}: are these times or rows exchanged?", listed(ids)));
}

}  // namespace

std::vector<std::size_t> rows_against_time(const MeasurementBatch& batch) {
  // The longest sequence that does not fall (patience sorting); all other rows must go.
  std::vector<std::size_t> known, tails, before(batch.measurements.size());
  const auto time = [&](std::size_t i) { return *batch.measurements[i].context.time; };
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    if (!batch.measurements[i].context.time) continue;
    known.push_back(i);
    const auto place =
        std::upper_bound(tails.begin(), tails.end(), time(i),
                         [&](double t, std::size_t other) { return t < time(other); });
    before[i] = place == tails.begin() ? i : *std::prev(place);
    if (place == tails.end()) {
      tails.push_back(i);
    } else {
      *place = i;
    }
  }
  std::vector<bool> rises(batch.measurements.size(), false);
  for (std::size_t i = tails.empty() ? 0 : tails.back(), k = tails.size(); k > 0;
       --k, i = before[i])
    rises[i] = true;
  std::erase_if(known, [&](std::size_t i) { return rises[i]; });
  return known;
}

void tell_row_mistakes(const Explained& explained, const MeasurementBatch& unsorted,
                       Diagnosis& diagnosis) {
  Misread misread(explained);
  for (SuspectedPose& suspect : diagnosis.suspects) {
    if (std::string reason = misread.reason(suspect); !reason.empty())
      suspect.reason = std::move(reason);
  }
  for (const auto& [what, ids] : misread.groups())
    diagnosis.limits.push_back(fmt::format("{}: {}", what, listed(ids)));
  tell_wrong_sides(explained, diagnosis);
  tell_tools_that_are_one(explained, diagnosis);
  tell_times(unsorted, diagnosis);
}

}  // namespace trammel::cause_search
