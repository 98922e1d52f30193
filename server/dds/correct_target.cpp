#include <utility>
#include <vector>

#include "idl/exchange/wire_values.h"
#include "server/compensate/exchanged.h"
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

/// The reply of a robot with these rails.
wire::CorrectedTarget told(const Correction& correction, const exchange::Rails& rails) {
  exchange::CorrectedTarget answer = exchanged(correction, rails);
  answer.message = cut(answer.message, kMaxMessage);
  return wire::to_wire(answer, rails);
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
      : subject_(std::move(subject)),
        rails_(exchange::rails_of(subject_.served->model.cell().robot)),
        targets_(std::move(targets)),
        recent_(recent),
        work_(work) {
    reply_.model(trammel::to_wire(*subject_.served, subject_.in_force, unix_now_s()));
    reply_.corrections().resize(targets_.size());
  }
  std::size_t items() const override { return targets_.size(); }
  void compute(std::size_t first, std::size_t count) override {
    const CompensatedModel& model = subject_.served->model;
    WorkFigures work;
    for (std::size_t i = first; i < first + count; ++i) {
      const Correction correction = model.correct(targets_[i], subject_.tool, subject_.payload);
      reply_.corrections()[i] = told(correction, rails_);
      count_in(work, correction);
      if (i == first && correction.q.size() > 0)
        remember(correction.q);  // one of each portion represents it
    }
    work_.add(subject_.served->cell, work);
  }
  wire::CorrectTargetReply take() override { return std::move(reply_); }

 private:
  void remember(const JointVector& q) {
    PoseContext asked;
    asked.q = q;
    asked.tool = subject_.tool;
    asked.payload = subject_.payload;
    asked.served = true;
    recent_.add(subject_.served->cell, std::move(asked));
  }

  const Subject subject_;
  const exchange::Rails rails_;
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
