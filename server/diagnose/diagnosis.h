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

/// The findings of a batch about the simulation: which physical causes it lacks, how sure that is,
/// and what cannot be told.
namespace trammel {

/// The smallest p-value that is given: no tail of a few hundred draws or permutations is known
/// further.
inline constexpr double kLeastPValue = 1e-6;

/// One physical cause, named as the contract spells it.
struct Cause {
  std::string cause;           ///< `gear_transmission`, `tool`, `outlier`, ...
  int joint = -1;              ///< 0-based; -1 where it concerns the whole arm
  std::string parameter = {};  ///< `C3`, `d6`: where one number of the cause is meant; else empty
  std::string pose_id = {};    ///< the pose at which it begins, or that is out; else empty
  std::optional<double> order = {};  ///< cycles a joint turn, of gear_transmission

  friend bool operator==(const Cause&, const Cause&) = default;
};
/// As files and programs spell it: `gear_transmission:3`, `geometry:d6`, `tracker_moved`. No pose,
/// no order.
[[nodiscard]] std::string to_string(const Cause& cause);
/// For people: `gear ripple in joint 3`, `link geometry (d6)`, `the tracker moved from pose p41
/// on`. No order. A cause that only another version of the program knows comes as it is spelled.
[[nodiscard]] std::string in_words(const Cause& cause);
/// The cause in words without its joint and pose, where a table has columns for them.
[[nodiscard]] std::string kind_in_words(const Cause& cause);
/// The name of a finding, all of it or without joint and pose. A pose that is out and may show
/// what the simulation lacks is no bad one.
[[nodiscard]] std::string called(const Cause& cause, bool is_in_doubt);
[[nodiscard]] std::string kind_called(const Cause& cause, bool is_in_doubt);
/// The record of the cause, wherever on the arm it is.
[[nodiscard]] const CauseRecord& record_of(const Cause& cause);
/// The cause of that record, of `joint` (0-based; -1: of no single one).
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
      {};  ///< as a cell file's list of error sources would spell it; empty for an outlier
  std::vector<Estimate> parameters = {};
  /// The poses where a cause that begins at a pose may have begun: those that the data cannot tell
  /// from that pose (95 %), it among them, in the order of measuring.
  std::vector<PossibleBeginning> may_begin_at = {};
  std::string since_session = {};  ///< of a batch of several sessions: the one in which it began
  double effect_rms =
      0;  ///< m, Euclidean, over the poses: what it does that nothing else in the model can
  ErrorFigures held_out_before = {};  ///< without this cause, the others found in place
  ErrorFigures held_out_after = {};   ///< with it
  double held_out_gain = 0;           ///< m: rms before - after
  double strength =
      0;  ///< lambda: whitened effect that nothing else in the model explains, squared
  double p_value =
      1;  ///< chance that the best of all candidates scores as much with nothing to find
  double naming_frequency = 1;            ///< share of bootstrap repetitions that name this cause
  std::vector<Cause> could_also_be = {};  ///< explain it as well; empty: named
  bool whole = true;  ///< false: the best known shape of it, and `unknown` among could_also_be:
                      ///< more than noise is left
  std::string action = {};  ///< for the shop floor
};

enum class Verdict { kNamed, kAmbiguous, kUnknown, kNothing };
[[nodiscard]] std::string_view to_string(Verdict verdict);
/// For people, from its spelling: `nothing` is told as `nothing beyond the model`, since the
/// drawing may be wrong by much.
[[nodiscard]] std::string verdict_in_words(std::string_view verdict);

/// The rest that is more than noise.
struct Unexplained {
  bool present = false;
  std::vector<std::string> depends_on;  ///< `q4`, `time`, `torque`
  double rms = 0;                       ///< m
  double p_value = 1;
  std::string hint = {};  ///< for people: what it may be, or what would show more; may be empty
};

/// The rest after all that was found, beside the stated sigma of one measurement.
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
  std::string needs;        ///< what would show it: `approach from both sides`, ...; empty: nothing
  double size_of_unit = 0;  ///< m rms: its average effect of strength 1; 0 where it does not show
};

/// Causes that these poses cannot tell apart.
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
      0;  ///< the 1 % line: what the best order of all joints reaches by chance in 1 of 100 batches
};

/// A step from the measured error to the repeatability.
struct WaterfallStep {
  std::string name;
  double rms = 0;  ///< m, of what is left after it
};

struct SuspectedPose {
  std::string pose_id;
  int row = 0;
  double distance = 0;  ///< m, from where the extended model has it
  std::string reason;
  bool held_out = false;  ///< nothing was learned from it anyway; it counts in the held-out figures
};

/// Measuring poses that would tell apart what this batch cannot.
struct NextPoses {
  std::vector<JointVector> q;    ///< rad; empty: none, for the reason in
  std::string none_because;      ///< for people
  std::vector<Cause> separates;  ///< the causes confounded now
  double stddev_now = 0;  ///< of the confounded combination, relative to the finding's own size
  double stddev_expected = 0;  ///< with these poses
  double stddev_random = 0;    ///< with as many random ones
};

/// The size that an effect must have to be named at these poses: measured by hiding it in simulated
/// noise.
struct Recovery {
  Cause cause;
  Eigen::VectorXd effect_rms;  ///< m, sizes hidden
  Eigen::VectorXd named;       ///< share of repetitions that were named rightly
};

/// Effects of one size that were put into what the best model leaves over, and what their diagnoses
/// said.
struct PutIn {
  double effect_rms = 0;  ///< m: average effect of that strength; 0: nothing was put in
  int tried = 0;
  int found = 0;     ///< the cause stands among the findings, for sure or in doubt
  int named = 0;     ///< the cause was named, rightly and for sure
  int misnamed = 0;  ///< another cause was named for sure
};

/// The size that an effect must have to be named, measured in the batch's own residuals
/// (prove/prove.h).
struct ProvedCause {
  Cause cause;
  std::vector<PutIn> sizes = {};         ///< those tried, the smallest first
  std::optional<double> predicted = {};  ///< m rms: Unseen::identifiable
  /// m rms: size that is named with kProvedShare, the median of what the counts allow, and its 95 %
  /// interval. Empty: no size is, as far as sizes were tried.
  std::optional<double> smallest = {}, from = {}, to = {};
  bool never = false;  ///< no size is, by more than chance (95 %)

  /// The counts tell a size.
  [[nodiscard]] bool is_proved() const { return smallest && from && to; }
};
/// Share of the effects of its smallest size that a cause must be named in.
inline constexpr double kProvedShare = 0.9;

/// The sizes that these poses name among the batch's own residuals.
struct Proof {
  std::vector<ProvedCause> causes;
  PutIn healthy;    ///< residuals into which nothing was put: `misnamed` are false names
  int refused = 0;  ///< diagnoses that refused their batch, counted as naming nothing
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
      between_sessions;  ///< what changed on the arm from one set-up to another; findings, too
  Unexplained unexplained;
  std::vector<Inseparable> not_separable;
  std::vector<Unseen> could_not_have_seen;
  std::vector<SuspectedPose> suspects;  ///< left out of the fit, or listed
  NextPoses next_poses;
  std::vector<Dependence> leftover;
  std::vector<std::string> limits;  ///< what the batch does not record, and what that rules out
  /// Rows that were left out since all together lead to no arm, and what is doubtful of the robot
  /// file: `sentence` begins with it.
  std::vector<Note> notes;
  /// Where the error of the drawing comes from, by the cell's error sources and the geometry.
  std::optional<ErrorBudget> budget;

  // For the page.
  std::vector<Periodogram> periodograms;
  std::vector<WaterfallStep> waterfall;
  std::vector<Recovery> recovery;
  std::optional<Proof> proof;          ///< where DiagnoseOptions::prove asks for it
  MeasurementBatch batch;              ///< as used
  Eigen::Matrix3Xd residual_before_B;  ///< 3 x poses, m: measured - calibrated
  Eigen::Matrix3Xd residual_after_B;
  std::vector<std::string> sources_before,
      sources_after;  ///< lists of error sources as a cell file spells them
  std::string batch_hash, cell_hash;
  std::uint64_t seed = 0;
};

}  // namespace trammel
