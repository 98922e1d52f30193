#pragma once

#include <Eigen/Dense>
#include <optional>
#include <string>
#include <vector>

#include "server/base/note.h"
#include "server/compensate/budget/budget.h"
#include "server/compensate/compensated_model.h"
#include "server/compensate/session_changes.h"
#include "server/error_sources/catalogue.h"

/// The findings of a batch about the simulation: the physical causes it lacks, the certainty of
/// each, and the questions that the batch leaves open.
namespace trammel {

/// The smallest p-value that is given: no tail of a few hundred draws or permutations is known
/// further.
inline constexpr double kLeastPValue = 1e-6;

/// One physical cause, named as the contract spells it.
struct Cause {
  std::string cause;                 ///< `gear_transmission`, `tool`, `outlier`, ...
  int joint = -1;                    ///< 0-based; -1 where it concerns the whole arm
  std::string parameter = {};        ///< `C3`, `d6` if one number of the cause is meant; else empty
  std::string pose_id = {};          ///< the pose at which it begins, or the outlier; else empty
  std::optional<double> order = {};  ///< cycles a joint turn, of gear_transmission

  friend bool operator==(const Cause&, const Cause&) = default;
};
/// The spelling for files and programs: `gear_transmission:3`, `geometry:d6`, `tracker_moved`.
/// Without pose and order.
[[nodiscard]] std::string to_string(const Cause& cause);
/// For people: `gear ripple in joint 3`, `link geometry (d6)`, `the tracker moved from pose p41
/// on`. No order. A cause that only another version of the program knows appears in its spelling.
[[nodiscard]] std::string in_words(const Cause& cause);
/// The cause in words without its joint and pose, for tables with separate columns for them.
[[nodiscard]] std::string kind_in_words(const Cause& cause);
/// The name of a finding, complete or without joint and pose. An outlier that may show an effect
/// missing from the simulation is not called a bad pose.
[[nodiscard]] std::string called(const Cause& cause, bool is_in_doubt);
[[nodiscard]] std::string kind_called(const Cause& cause, bool is_in_doubt);
/// The record of the cause, wherever on the arm it is.
[[nodiscard]] const CauseRecord& record_of(const Cause& cause);
/// The cause of that record and `joint` (0-based; -1: no single joint).
[[nodiscard]] Cause cause_at(const CauseRecord& record, int joint = -1);
/// Something is there, of `joint` (-1: of any), and no known cause is it.
[[nodiscard]] Cause unknown_cause(int joint = -1);
/// Adds a cause that is not yet among `causes`.
void add(std::vector<Cause>& causes, const Cause& cause);

/// A number found, in the unit people read it in.
struct Estimate {
  std::string name;
  std::string unit;
  double value = 0;
  double u95 = 0;  ///< U(k=2): two standard uncertainties, everything else free
};

/// A pose at which something may have begun.
struct PossibleBeginning {
  std::string pose_id;
  int row = 0;
  std::optional<double> time;  ///< s, as recorded
};

/// A cause that the simulation lacks.
struct Finding {
  Cause cause;
  std::string source =
      {};  ///< the spelling in a cell file's list of error sources; empty for an outlier
  std::vector<Estimate> parameters = {};
  /// For a cause that begins at a pose: the poses at which it may have begun (95 %), in the order
  /// of measuring. The data do not distinguish them; the pose found is among them.
  std::vector<PossibleBeginning> may_begin_at = {};
  std::string since_session = {};  ///< in a batch of several sessions: the session in which it
                                   ///< began
  double effect_rms = 0;  ///< m, Euclidean, over the poses: the part of its effect that nothing
                          ///< else in the model can have
  ErrorFigures held_out_before = {};  ///< without this cause, the others found in place
  ErrorFigures held_out_after = {};   ///< with the cause
  double held_out_gain = 0;           ///< m: rms before - after
  double strength = 0;  ///< lambda: squared whitened effect that nothing else in the model explains
  double p_value =
      1;  ///< chance of such a score by the best candidate when there is nothing to find
  double naming_frequency = 1;            ///< share of bootstrap repetitions that name this cause
  std::vector<Cause> could_also_be = {};  ///< explain it as well; empty: named
  bool whole = true;  ///< false: it is the best known shape of an unknown effect, with `unknown`
                      ///< among could_also_be, since more than noise is left
  std::string action = {};  ///< for the shop floor
};

enum class Verdict { kNamed, kAmbiguous, kUnknown, kNothing };
[[nodiscard]] std::string_view to_string(Verdict verdict);
/// For people, from its spelling. `nothing` becomes `nothing beyond the model`, since the drawing
/// may be wrong by much.
[[nodiscard]] std::string verdict_in_words(std::string_view verdict);

/// The rest that is more than noise.
struct Unexplained {
  bool present = false;
  std::vector<std::string> depends_on;  ///< `q4`, `time`, `torque`
  double rms = 0;                       ///< m
  double p_value = 1;
  std::string hint = {};  ///< for people: a likely nature, or a measurement that would show more;
                          ///< may be empty
};

/// The residual after all findings, beside the stated sigma of one measurement.
struct LeftOver {
  double left = 0, stated = 0;  ///< standard deviation per axis, m or rad
  double freedom = 0;           ///< degrees of freedom; 0 where nothing was measured
};

/// A cause that this batch could not have shown, or only from some size on.
struct Unseen {
  Cause cause;
  double outside =
      0;  ///< share of its effect that the cell's own error sources do not absorb, [0, 1]
  std::optional<double> detectable;    ///< m rms over the poses: smallest effect that would be
                                       ///< noticed; empty: none would
  std::optional<double> identifiable;  ///< m rms: smallest that would be named
  std::string needs;  ///< the remedy that would show it: `approach from both sides`, ...; empty:
                      ///< none
  double size_of_unit = 0;  ///< m rms: its average effect at strength 1; 0 if it has none
};

/// Causes that these poses cannot separate.
struct Inseparable {
  std::vector<Cause> causes;
  double correlation = 0;  ///< canonical, after projection
};

/// One line of a joint's periodogram.
struct Periodogram {
  int joint = 0;  ///< 0-based
  Eigen::VectorXd order;
  Eigen::VectorXd strength;  ///< lambda at each order, before anything was added
  double limit =
      0;  ///< the 1 % line: the best order of all joints reaches it by chance in 1 of 100 batches
};

/// A step from the measured error to the repeatability.
struct WaterfallStep {
  std::string name;
  double rms = 0;  ///< m, of the residual after it
};

struct SuspectedPose {
  std::string pose_id;
  int row = 0;
  double distance = 0;  ///< m, from the position by the extended model
  std::string reason;
  bool held_out = false;  ///< it was held out from learning, and counts in the held-out figures
};

/// Measuring poses that would distinguish causes which this batch leaves open.
struct NextPoses {
  std::vector<JointVector> q;    ///< rad; empty: none, for the reason in
  std::string none_because;      ///< for people
  std::vector<Cause> separates;  ///< the causes confounded now
  double stddev_now = 0;  ///< of the confounded combination, relative to the finding's own size
  double stddev_expected = 0;  ///< with these poses added
  double stddev_random = 0;    ///< with equally many random ones
};

/// The smallest effect that is named at these poses, found by hiding effects in simulated noise.
struct Recovery {
  Cause cause;
  Eigen::VectorXd effect_rms;  ///< m, sizes hidden
  Eigen::VectorXd named;       ///< share of repetitions that were named rightly
};

/// Effects of one size that were added to the residuals of the best model, and the results of their
/// diagnoses.
struct PutIn {
  double effect_rms = 0;  ///< m: average effect of that strength; 0: nothing was added
  int tried = 0;
  int found = 0;     ///< the cause is among the findings, certain or in doubt
  int named = 0;     ///< the cause was named correctly and with certainty
  int misnamed = 0;  ///< another cause was named with certainty
};

/// The size from which an effect is named, measured in the batch's own residuals (prove/prove.h).
struct ProvedCause {
  Cause cause;
  std::vector<PutIn> sizes = {};         ///< the tried sizes, the smallest first
  std::optional<double> predicted = {};  ///< m rms: Unseen::identifiable
  /// m rms: the size that is named with kProvedShare: the median according to the counts, and its
  /// 95 % interval. Empty if no tried size reaches that.
  std::optional<double> smallest = {}, from = {}, to = {};
  bool never = false;  ///< no size reaches that, beyond chance (95 %)

  /// True if the counts determine a size.
  [[nodiscard]] bool is_proved() const { return smallest && from && to; }
};
/// Share of the effects of the smallest size in which a cause must be named.
inline constexpr double kProvedShare = 0.9;

/// The sizes from which these poses show each cause among the batch's own residuals.
struct Proof {
  std::vector<ProvedCause> causes;
  PutIn healthy;    ///< residuals without an added effect: `misnamed` are false names
  int refused = 0;  ///< diagnoses that refused their batch; they count as naming nothing
};

/// The dependence of what is left on something, by permutation.
struct Dependence {
  std::string on;        ///< `q3`, `torque`, `time`
  bool of_size = false;  ///< of |residual| rather than of the residual
  double p_value = 1;    ///< Holm-corrected
};

struct Diagnosis {
  Verdict verdict = Verdict::kNothing;
  std::string sentence;  ///< the verdict for people, graded by the evidence
  int poses = 0;         ///< repeats merged
  double noise =
      0;  ///< m per axis: standard deviation of a pose that no cause explains, whatever its reason
  double instrument = 0;  ///< m per axis: standard deviation that is stated for a measurement
  std::string noise_from;
  LeftOver left_position, left_rotation;  ///< m; rad
  ErrorFigures before, after;             ///< of all poses used, before and after extension
  std::optional<ErrorFigures> held_out_before, held_out_after;
  /// The figures without the poses held out that fit neither model; empty where there are none.
  std::optional<ErrorFigures> held_out_before_without, held_out_after_without;
  std::string held_out_how;  ///< `validation rows` or `8 blocks, each predicted from the others`
  std::vector<Finding> findings;
  std::vector<SessionChange>
      between_sessions;  ///< changes on the arm between set-ups; they are findings, too
  Unexplained unexplained;
  std::vector<Inseparable> not_separable;
  std::vector<Unseen> could_not_have_seen;
  std::vector<SuspectedPose> suspects;  ///< left out of the fit, or listed
  NextPoses next_poses;
  std::vector<Dependence> leftover;
  std::vector<std::string> limits;  ///< quantities that the batch does not record, and the causes
                                    ///< that this rules out
  /// Rows that were left out because all together fit no arm, and doubts about the robot file:
  /// `sentence` begins with these notes.
  std::vector<Note> notes;
  /// The origin of the drawing's error, by the cell's error sources and the geometry.
  std::optional<ErrorBudget> budget;

  // For the page.
  std::vector<Periodogram> periodograms;
  std::vector<WaterfallStep> waterfall;
  std::vector<Recovery> recovery;
  std::optional<Proof> proof;          ///< if DiagnoseOptions::prove requests it
  MeasurementBatch batch;              ///< as used
  Eigen::Matrix3Xd residual_before_B;  ///< 3 x poses, m: measured - calibrated
  Eigen::Matrix3Xd residual_after_B;
  std::vector<std::string> sources_before,
      sources_after;  ///< lists of error sources as a cell file spells them
  std::string batch_hash, cell_hash;
  std::uint64_t seed = 0;
};

}  // namespace trammel
