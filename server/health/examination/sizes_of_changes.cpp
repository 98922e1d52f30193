// The size of a change that was seen, over the working poses or at the check's.
#include <algorithm>

#include "server/health/examination/examination.h"
#include "server/health/examination/seen_change.h"

namespace trammel::health {

using Eigen::Index;

namespace {

constexpr double kExtrapolated =
    10;  // times the deviation of the poses: they do not show an effect that large

}  // namespace

bool Examination::is_tool(std::size_t hypothesis) const {
  return effects_.causes()[questions_.hypotheses[hypothesis].cause].columns ==
         effects_.tool_columns();
}

Estimate Examination::estimated(std::size_t hypothesis, const RefittedRows& refitted) const {
  const Hypothesis& one = questions_.hypotheses[hypothesis];
  const SingleCause& cause = effects_.causes()[one.cause].cause;
  const double widest = cause.any_function ? kWidestFunction
                        : is_zero(cause)   ? kWidestZero
                                           : kWidest;
  return estimate(refitted.left(one.columns), refitted.left(rows_.residual), widest);
}

Size Examination::size(std::size_t hypothesis, const Estimate& found) const {
  const CauseEffects::Entry& entry = effects_.causes()[questions_.hypotheses[hypothesis].cause];
  return entry.cause.any_function
             ? size_of_any(found, working_.any_function_rms(entry.columns.front()))
             : size_of(found, working_.left_square(entry.columns));
}

Eigen::MatrixXd Examination::square_here(const Eigen::MatrixXd& columns,
                                         const RefittedRows& refitted) const {
  const Eigen::MatrixXd all = refitted.unwhitened(refitted.left(columns));
  Eigen::MatrixXd square = Eigen::MatrixXd::Zero(columns.cols(), columns.cols());
  for (const Index first : rows_.first)
    square += all.middleRows<3>(first).transpose() * all.middleRows<3>(first);
  return square / static_cast<double>(rows_.poses());
}

void Examination::set_size(const Size& over, const Estimate& found, const Eigen::MatrixXd& here,
                           SeenChange& change) const {
  change.at_these_poses = over.rms > off_;
  const Size told = change.at_these_poses ? size_of(found, here) : over;
  change.effect_rms = std::min(told.rms, off_);
  change.u95 = told.u95;
}

bool Examination::is_extrapolated(std::size_t hypothesis, const RefittedRows& refitted) const {
  return size(hypothesis, estimated(hypothesis, refitted)).rms > kExtrapolated * off_;
}

}  // namespace trammel::health
