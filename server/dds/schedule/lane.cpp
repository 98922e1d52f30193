#include "server/dds/schedule/lane.h"

#include <pthread.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

namespace trammel {
namespace {

constexpr std::size_t kMostAtOnce = 256;    // items between two looks at the clock
constexpr std::size_t kPartsOfPortion = 8;  // a look at the clock after about such a part
constexpr std::chrono::milliseconds kSoon{1000};
constexpr std::chrono::milliseconds kLateTick{50};  // the delay with which a lack of time is
                                                    // reported

/// The number of items that take about an eighth of a portion, by the items computed so far.
std::size_t next_size(std::size_t items, Cost took, Cost portion) {
  if (items == 0 || took <= Cost(0)) return 1;
  const double fits = static_cast<double>(items) / took.count() * portion.count() / kPartsOfPortion;
  return std::clamp(static_cast<std::size_t>(std::min(fits, 1e6)), std::size_t{1}, kMostAtOnce);
}

}  // namespace

Lane::Lane(const TurnLimits& limits, Room& room, int nice, Clock now)
    : limits_(limits), room_(room), nice_(nice), now_(std::move(now)), turns_(limits) {}

Lane::~Lane() { stop(); }

void Lane::start() {
  for (std::size_t i = 0; i < limits_.workers + limits_.express_workers; ++i) {
    const auto which = i < limits_.workers ? Turns::Which::kAll : Turns::Which::kShort;
    workers_.emplace_back([this, which](const std::stop_token& stop) { work(stop, which); });
  }
  workers_.emplace_back([this](const std::stop_token& stop) { watch_times(stop); });
}

void Lane::stop() {
  for (std::jthread& worker : workers_) worker.request_stop();
  workers_.clear();
  std::deque<std::shared_ptr<Turns::Entry>> left;
  {
    const MutexLock lock(mutex_);
    stopped_ = true;
    left = turns_.clear();
  }
  for (const auto& entry : left) entry->job().shed({"the server stops", kSoon, false});
}

std::optional<Shed> Lane::submit(std::shared_ptr<Job> job, Ask ask) {
  auto place = room_.take(ask.client, ask.cell, ask.bytes);
  bool all_are_busy = false;
  {
    const MutexLock lock(mutex_);
    if (stopped_) return Shed{"the server stops", kSoon, false};
    if (!place)
      return Shed{"the memory for waiting requests is used up", turns_.retry_after(ask.client),
                  false};
    if (auto shed = turns_.add(std::move(job), std::move(ask), std::move(*place), now_()))
      return shed;
    waits_ = true;
    workable_ = true;
    all_are_busy = idle_ == 0;
    express_waits_ = express_waits_ || all_are_busy;
  }
  (all_are_busy ? express_arrived_ : arrived_).notify_one();
  return std::nullopt;
}

void Lane::set_limits(const TurnLimits& limits) {
  const MutexLock lock(mutex_);
  turns_.set_limits(limits);
}

std::optional<Turns::Portion> Lane::next(Turns::Which which) {
  auto portion = turns_.next(now_(), which);
  if (which == Turns::Which::kShort) {
    express_waits_ = portion.has_value();
  } else {
    waits_ = portion.has_value() && turns_.has_work();
    workable_ = waits_;
    if (waits_ && idle_ > 0) arrived_.notify_one();
  }
  if (portion) ++taken_up_;
  return portion;
}

void Lane::work(const std::stop_token& stop, Turns::Which which) {
  ::pthread_setname_np(::pthread_self(), "requests");
  // The priority of this thread alone, which Linux allows.
  if (nice_ != 0) ::setpriority(PRIO_PROCESS, static_cast<id_t>(::syscall(SYS_gettid)), nice_);
  while (!stop.stop_requested()) {
    if (step(which)) continue;
    MutexLock lock(mutex_);
    if (which == Turns::Which::kShort) {
      express_arrived_.wait(lock, stop,
                            [this]() TRAMMEL_REQUIRES(mutex_) { return express_waits_; });
      continue;
    }
    ++idle_;
    arrived_.wait(lock, stop, [this]() TRAMMEL_REQUIRES(mutex_) { return waits_; });
    --idle_;
  }
}

void Lane::watch_times(const std::stop_token& stop) {
  ::pthread_setname_np(::pthread_self(), "late requests");
  while (!stop.stop_requested()) {
    {
      MutexLock lock(mutex_);
      next_look_.wait_for(lock, stop, kLateTick, [] { return false; });
    }
    shed_late();
  }
}

void Lane::shed_late() {
  const auto next_late = [this] {
    const MutexLock lock(mutex_);
    return turns_.next_late(now_());
  };
  while (const auto late = next_late()) late->entry->job().shed(late->shed);
}

bool Lane::step(Turns::Which which) {
  std::optional<Turns::Portion> portion;
  {
    const MutexLock lock(mutex_);
    portion = next(which);
  }
  if (portion) run(*portion);
  return portion.has_value();
}

void Lane::run(const Turns::Portion& portion) {
  if (portion.part == Turns::Part::kShed) {
    portion.entry->job().shed(portion.shed);
    return;
  }
  const Turns::Done done = work_on(portion);
  bool given_up = false;
  {
    const MutexLock lock(mutex_);
    given_up = turns_.settle(portion, done, now_());
  }
  if (given_up) portion.entry->job().shed({"it was not done in time", kSoon, true});
}

Turns::Done Lane::work_on(const Turns::Portion& portion) {
  const WorkUnderWay::Piece piece = under_way_.begin();
  Turns::Entry& entry = *portion.entry;
  const SteadyTime begun = now_();
  Turns::Done done;
  if (portion.part == Turns::Part::kBegin && !begin(entry)) {
    done.answered = true;
  } else {
    compute(entry, begun, &done);
  }
  if (done.answered) entry.job().finish();
  done.took = Cost(now_() - begun);
  return done;
}

bool Lane::begin(Turns::Entry& entry) {
  const std::size_t items = entry.job().begin();
  {
    const MutexLock lock(mutex_);
    turns_.open(entry, items);
    waits_ = waits_ || items > 1;
  }
  if (items > 1) arrived_.notify_all();
  return items > 0;
}

void Lane::compute(Turns::Entry& entry, SteadyTime begun, Turns::Done* done) {
  SteadyTime from = now_();
  while (!done->answered && from - begun < limits_.portion) {
    std::size_t first = 0;
    const std::size_t count =
        entry.claim(next_size(done->items, done->computing, limits_.portion), &first);
    if (count == 0) return;
    entry.job().compute(first, count);
    done->items += count;
    done->answered = entry.computed(count);
    const SteadyTime until = now_();
    done->computing += until - from;
    from = until;
  }
}

std::size_t Lane::requests() const {
  const MutexLock lock(mutex_);
  return turns_.requests();
}

std::optional<std::uint64_t> Lane::unseen() const {
  const std::uint64_t taken_up = taken_up_;
  if (!workable_ || idle_ == 0) return std::nullopt;
  return taken_up;
}

}  // namespace trammel
