#pragma once

#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "server/health/evidence/check_rows.h"
#include "server/health/evidence/check_tests.h"
#include "server/health/evidence/lost_zeros.h"
#include "server/health/examination/due.h"
#include "server/health/examination/sizes.h"
#include "server/health/examination/verdict.h"
#include "server/health/health_verdict.h"

/// A check's residuals are tested for each single cause beside base (and tool), for single bad
/// poses, and as a whole. The hypothesis with the best score is taken (its gain less Schwarz's
/// price, log R for each parameter). A bad pose is then refitted with the base, a cause becomes a
/// change, and the rest is tested again. Effects are linear in the cause. Zeros of several joints
/// come first, as one explanation of all poses, and are not linear.
namespace trammel::health {

inline constexpr double kAlike = 6;  ///< of scores: odds of e^3

/// One check during its examination.
class Examination {
 public:
  Examination(const HealthOptions& options, const CauseEffects& effects,
              const WorkingPoses& working, CheckRows rows, int tail_freedom, const Chain& robot);
  [[nodiscard]] HealthCheck result(const CheckTimes& times);

 private:
  /// A cause that the check found, and the chance of such an effect in a healthy robot.
  struct Named {
    std::size_t hypothesis = 0;
    double chance = 1;
  };

  [[nodiscard]] Questions questions() const;
  /// Refitted in a healthy robot.
  [[nodiscard]] Eigen::MatrixXd frames_of(const CheckRows& rows) const;
  /// Causes that are the zero of a turning joint and that base (and tool) do not absorb.
  [[nodiscard]] std::vector<std::size_t> zeros_of(const Chain& robot) const;
  /// Refitted in any case, at `there`: frames, and bad poses.
  [[nodiscard]] Eigen::MatrixXd always_at(const CheckRows& there) const;
  /// Zeros that several joints lost, or a large one of a single joint, if nothing simpler explains
  /// all poses as well and no residual is left beyond chance. If a residual is left, one or two bad
  /// poses are searched beside them.
  [[nodiscard]] std::optional<ZerosFit> lost_zeros();
  /// The likeliest of `fits_`, without these poses; empty if it does not explain the poses.
  [[nodiscard]] std::optional<ZerosFit> likeliest_zeros(const std::vector<int>& bad);
  /// The pose that fits all zeros and the tool together worst, beyond its price.
  [[nodiscard]] std::optional<int> pose_that_fits_no_zeros(const std::vector<int>& bad) const;
  /// The score by Schwarz's criterion, relative to no change, which leaves `whole`.
  [[nodiscard]] double score_of(const ZerosFit& fit, double whole) const {
    return whole - fit.left - price(fit.numbers);
  }
  [[nodiscard]] double price(int numbers) const {
    return std::log(static_cast<double>(rows_.residual.size())) * numbers;
  }
  /// True if a single cause explains as much per number, in the residual of `tests`.
  [[nodiscard]] bool has_simpler(const CheckTests& tests, double score) const;
  /// True if the bad poses explain as much per number.
  [[nodiscard]] bool are_bad_poses(double score);
  void tell_zeros(const ZerosFit& fit);
  void tell_tool_beside(const ZerosFit& fit, const CheckRows& there);
  /// Adds to a tool the zeros that it absorbs at any poses, unless these poses show that it has not
  /// turned. `others`: refitted beside the tool. `named`: zeros to skip.
  void tell_zeros_in_tool(const CheckRows& there, const Eigen::MatrixXd& others,
                          const std::vector<std::size_t>& named, SeenChange& change);
  /// True if orientations show that the tool has moved without the turn that this zero would make.
  [[nodiscard]] bool has_not_turned(const CheckRows& there, const Eigen::MatrixXd& others,
                                    std::size_t zero, const SeenChange& tool) const;
  void tell_other_sets(const ZerosFit& fit, SeenChange& change) const;
  /// Adds the causes that explain as much as this cause if `others` are fitted too.
  void tell_rivals_beside(const CheckRows& there, const Eigen::MatrixXd& others, std::size_t cause,
                          SeenChange& change) const;
  /// Reports several zeros as a rival if, with `numbers` parameters, they explain as much as the
  /// named change.
  void tell_several_zeros(double left, int numbers, SeenChange& change) const;
  void look_for_changes(const CheckTests& healthy);
  void tell_what_is_left();
  /// m rms of the positions, refitted.
  [[nodiscard]] double distance_of(const RefittedRows& refitted) const;
  /// True if the cause is a displaced tool, whose shift is linear at any size.
  [[nodiscard]] bool is_tool(std::size_t hypothesis) const;
  /// Looks once. True if a cause was found, and the rest is to be looked at again.
  bool look_once(const CheckTests& tests);
  /// Tests each cause again beside the others: removes needless ones, and adds one that now fits
  /// better.
  void look_back();
  /// The cause that explains most for its price; empty: none explains anything.
  [[nodiscard]] std::optional<std::size_t> likeliest(const CheckTests& tests,
                                                     const Eigen::VectorXd& left) const;
  [[nodiscard]] bool may_be_named(std::size_t hypothesis, const CheckTests& tests,
                                  const Eigen::VectorXd& left) const;
  /// The likeliest hypothesis, even if its size is far beyond a credible value.
  [[nodiscard]] std::size_t most_explained(const CheckTests& tests,
                                           const Eigen::VectorXd& left) const;
  /// Refitted besides: all that were named but the one at `k`.
  [[nodiscard]] CheckTests beside_others(std::size_t k) const;
  void refit_named();
  [[nodiscard]] Estimate estimated(std::size_t hypothesis, const RefittedRows& refitted) const;
  /// Over the working poses.
  [[nodiscard]] Size size(std::size_t hypothesis, const Estimate& found) const;
  /// k x k, m²: the squared effect of these columns at the check's poses.
  [[nodiscard]] Eigen::MatrixXd square_here(const Eigen::MatrixXd& columns,
                                            const RefittedRows& refitted) const;
  /// Sets the size to `over`, or, if that exceeds the deviation of the poses, to the part that the
  /// poses show.
  void set_size(const Size& over, const Estimate& found, const Eigen::MatrixXd& here,
                SeenChange& change) const;
  /// True if the cause would do far more elsewhere than these poses are off by: they do not show
  /// it.
  [[nodiscard]] bool is_extrapolated(std::size_t hypothesis, const RefittedRows& refitted) const;
  void tell_change(const Named& named, const CheckTests& tests);
  void tell_rivals(std::size_t hypothesis, const CheckTests& tests,
                   const std::vector<double>& scores, SeenChange& change) const;
  [[nodiscard]] std::vector<bool> credible(const std::vector<double>& scores) const;
  /// True if a common increase of all residuals explains as much as the best cause.
  [[nodiscard]] bool is_scatter(std::size_t hypothesis, const CheckTests& tests,
                                const Eigen::VectorXd& left) const;
  void unknown_found(double chance, const Eigen::VectorXd& left, int freedom);
  void tell_rms(const RefittedRows& refitted);
  /// R: its effect at the check's poses.
  [[nodiscard]] Eigen::VectorXd rows_of(const CauseSignal& signal) const;
  /// R x S: of all signals, refitted.
  [[nodiscard]] Eigen::MatrixXd drift(const RefittedRows& refitted) const;
  /// lambda of each signal of a cause, of 1 m rms.
  [[nodiscard]] std::vector<double> strengths(std::size_t cause,
                                              const RefittedRows& refitted) const;
  void tell_smallest(const CheckTests& tests);

  const HealthOptions& options_;
  const CauseEffects& effects_;
  const WorkingPoses& working_;
  const CheckRows rows_;
  const std::vector<CauseSignal> signals_;
  const Questions questions_;
  HealthyChecks healthy_;
  const ZerosSearch zeros_;
  std::vector<ZerosFit> fits_;  // of `zeros_`, if the residual is beyond chance
  Sifted sifted_;
  Eigen::MatrixXd covariance_;  // including the uncertainty of changes already found
  Eigen::MatrixXd always_;      // refitted: frames and bad poses
  Eigen::MatrixXd nuisance_;    // nuisance columns, and changes already found
  std::vector<Named> named_;
  double off_ = 0;       // m rms of the positions
  bool is_far_ = false;  // only a tool that sits elsewhere is named
  Doubt doubt_;
  HealthCheck check_;
};

[[nodiscard]] Eigen::MatrixXd joined(const Eigen::MatrixXd& one, const Eigen::MatrixXd& other);

}  // namespace trammel::health
