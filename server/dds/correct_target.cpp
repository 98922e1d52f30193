#include <utility>
#include <vector>

#include "server/base/units.h"
#include "server/dds/codec.h"
#include "server/dds/handlers.h"

namespace trammel {
namespace {

/// Keeps the largest reply below its sample limit.
constexpr std::size_t kMaxMessage = 180;
constexpr int kMaxConf = 7;

Result<Target> from_wire(const wire::Target& wanted, const Chain& chain, const std::string& where) {
  Target target;
  target.joint_target = wanted.kind() == wire::TARGET_JOINTS;
  if (!target.joint_target) {
    const auto X_BT = TRY(trammel::from_wire(wanted.pose(), where));
    target.X_BT = X_BT;
  }
  PoseContext comes;
  TRY(read_approach(wanted.approach(), chain, where, comes));
  target.direction = std::move(comes.direction);
  target.temperature = comes.temperature;
  target.time = comes.time;
  if (wanted.kind() == wire::TARGET_POSE_ON_BRANCH) {
    if (wanted.conf() < 0 || wanted.conf() > kMaxConf) {
      return refused("branch {} is not one of 0 to {}", wanted.conf(), kMaxConf)
          .in(where)
          .of("conf")
          .beyond(wanted.conf(), kMaxConf);
    }
    target.conf = wanted.conf();
    return target;
  }
  const auto seed = TRY(trammel::from_wire(wanted.joints_rad(), chain, where));
  target.seed = seed;
  return target;
}

wire::CorrectedTarget to_wire(const Correction& correction, const Chain& chain) {
  wire::CorrectedTarget item;
  item.status(trammel::to_wire(correction.status));
  item.commanded(trammel::to_wire(correction.X_BT_commanded));
  item.joints_rad(trammel::to_wire(correction.q, chain));
  item.error_before_mm(to_mm(correction.error_before));
  item.error_after_mm(to_mm(correction.error_after));
  item.sigma_mm(to_mm(correction.stddev));
  item.sigma_measured_mm(to_mm(correction.measured_stddev));
  item.turn_before_rad(correction.turn_before);
  item.turn_after_rad(correction.turn_after);
  item.iterations(correction.iterations);
  item.message(cut(correction.message, kMaxMessage));
  return item;
}

void count_in(WorkFigures& work, const Correction& correction) {
  const bool outside = correction.status == CorrectionStatus::kOutOfDomain;
  if (outside || correction.status == CorrectionStatus::kOk) {
    work.answered(!outside, correction.stddev);
  } else {
    ++work.left;
  }
}

/// Its targets are known, its model is taken.
class PortionedCorrections final : public PortionedAnswer<wire::CorrectTargetReply> {
 public:
  PortionedCorrections(Subject subject, std::vector<Target> targets, RecentPoses& recent,
                       WorkCounts& work)
      : subject_(std::move(subject)), targets_(std::move(targets)), recent_(recent), work_(work) {
    reply_.model(trammel::to_wire(*subject_.served, subject_.in_force, unix_now_s()));
    reply_.corrections().resize(targets_.size());
  }
  std::size_t items() const override { return targets_.size(); }
  void compute(std::size_t first, std::size_t count) override {
    const CompensatedModel& model = subject_.served->model;
    WorkFigures work;
    for (std::size_t i = first; i < first + count; ++i) {
      const Correction correction = model.correct(targets_[i], subject_.tool, subject_.payload);
      reply_.corrections()[i] = to_wire(correction, model.cell().robot);
      count_in(work, correction);
      if (i == first && correction.q.size() > 0)
        remember(correction.q);  // one of each portion stands for it
    }
    work_.add(subject_.served->cell, work);
  }
  wire::CorrectTargetReply take() override { return std::move(reply_); }

 private:
  const Subject subject_;
  void remember(const JointVector& q) {
    PoseContext asked;
    asked.q = q;
    asked.tool = subject_.tool;
    asked.payload = subject_.payload;
    asked.served = true;
    recent_.add(subject_.served->cell, std::move(asked));
  }

  const std::vector<Target> targets_;
  RecentPoses& recent_;  // of the trainer, which outlives every request
  WorkCounts& work_;
  wire::CorrectTargetReply reply_;
};

}  // namespace

Result<Handlers::Corrections> Handlers::begin(const wire::CorrectTargetRequest& request) {
  const auto& wanted = request.targets();
  auto subject = TRY(subjects_.find(request.about()));
  const Chain& chain = subject.served->model.cell().robot;

  std::vector<Target> targets;
  targets.reserve(wanted.size());
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    const auto target = TRY(from_wire(wanted[i], chain, fmt::format("target {}", i + 1)));
    targets.push_back(target);
  }
  return std::make_unique<PortionedCorrections>(std::move(subject), std::move(targets),
                                                trainer_.recent_poses(), work_);
}

Result<wire::CorrectTargetReply> Handlers::answer(const wire::CorrectTargetRequest& request) {
  return computed(begin(request));
}

bool happens_once(const wire::CorrectTargetRequest&) { return false; }

}  // namespace trammel
