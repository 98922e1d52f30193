#include "server/dds/reply_channels.h"

#include <pthread.h>

#include <algorithm>
#include <list>
#include <utility>

namespace trammel {
namespace {

using Clock = std::chrono::steady_clock;

/// A channel that was opened or used so lately is not given to another client.
constexpr auto kGrace = 5 * wire::kAnnouncement;
constexpr std::chrono::milliseconds kLook{500};  // period of the search for expired replies
constexpr std::size_t kWrittenAtOnce = 64;

OutboxLimits limits_of_kept() {
  OutboxLimits limits;
  limits.client_replies = wire::kReplyDepth;
  return limits;
}

}  // namespace

ReplyChannels::ReplyChannels(wire::dds::DomainParticipant& participant, std::size_t capacity,
                             std::function<void()> wants_tending, WorkUnderWay& writing)
    : participant_(participant),
      wants_tending_(std::move(wants_tending)),
      writing_(writing),
      book_(capacity, kGrace),
      posted_(OutboxLimits{}),
      kept_(limits_of_kept()) {}

void ReplyChannels::add_topic(wire::dds::Topic* topic, InsteadOf instead) {
  const MutexLock lock(mutex_);
  topics_[topic->get_name()] = {topic, std::move(instead)};
}

void ReplyChannels::heard(const std::vector<ReaderEvent>& events) {
  const MutexLock lock(mutex_);
  for (const ReaderEvent& event : events) {
    if (event.kind == ReaderEvent::Kind::kLeft) book_.left(event.reader.participant);
    if (!topics_.contains(event.reader.topic)) continue;
    if (event.kind == ReaderEvent::Kind::kFound) book_.found(event.reader, Clock::now());
    if (event.kind == ReaderEvent::Kind::kLost) book_.lost(event.reader);
  }
}

bool ReplyChannels::tend() {
  std::vector<ChannelBook::Change> changes;
  std::vector<std::shared_ptr<ReplyChannel>> unused;  // parked without the lock
  bool somebody_waits = false;
  {
    const MutexLock lock(mutex_);
    changes = book_.changes(Clock::now());
    somebody_waits = book_.somebody_waits() || !closed_.empty();
    const auto used = std::partition(closed_.begin(), closed_.end(),
                                     [](const auto& one) { return one->is_in_use(); });
    unused.assign(std::make_move_iterator(used), std::make_move_iterator(closed_.end()));
    closed_.erase(used, closed_.end());
  }
  for (auto& channel : unused) parked_.park(std::move(channel), Clock::now());
  for (const ChannelBook::Change& each : changes) change(each);
  return parked_.tend(Clock::now()) || somebody_waits;
}

void ReplyChannels::change(const ChannelBook::Change& change) {
  if (change.kind == ChannelBook::Change::Kind::kClose) {
    close(change.partition);
  } else {
    open(change);
  }
}

void ReplyChannels::open(const ChannelBook::Change& change) {
  std::shared_ptr<ReplyChannel> channel;
  ReplyTopic of;
  {
    const MutexLock lock(mutex_);
    of = topics_.at(change.topic);
    if (const auto found = channels_.find(change.partition); found != channels_.end())
      channel = found->second;
  }
  if (!channel) channel = parked_.take(change.participant, change.partition);
  if (!channel) channel = std::make_shared<ReplyChannel>(participant_, change.partition);
  if (channel->publisher() == nullptr) return;
  Writer writer = channel->writer(change.topic);
  if (!writer)
    writer = ReplyWriter::make(
        *channel->publisher(), of.topic, [this] { matched(); }, of.instead);
  {
    const MutexLock lock(mutex_);
    if (writer) channel->add(change.topic, std::move(writer));
    channels_[change.partition] = std::move(channel);
  }
  matched();  // perhaps before the writer was known here
}

void ReplyChannels::close(const std::string& partition) {
  std::shared_ptr<ReplyChannel> unused;
  {
    const MutexLock lock(mutex_);
    const auto found = channels_.find(partition);
    if (found == channels_.end()) return;
    if (found->second->is_in_use()) {
      closed_.push_back(std::move(found->second));
    } else {
      unused = std::move(found->second);
    }
    channels_.erase(found);
  }
  if (unused) parked_.park(std::move(unused), Clock::now());
}

void ReplyChannels::matched() {
  {
    const MutexLock lock(mutex_);
    has_matched_ = true;
  }
  due_.notify_all();
}

std::shared_ptr<ReplyChannels::Expectation> ReplyChannels::expect(const std::string& participant,
                                                                  const std::string& partition) {
  bool wants_channel = false;
  {
    const MutexLock lock(mutex_);
    if (!book_.may_listen(participant, partition)) return nullptr;
    wants_channel = book_.asked(partition, Clock::now());
  }
  if (wants_channel) wants_tending_();
  return std::make_shared<Expectation>(*this, partition);
}

void ReplyChannels::answered(const std::string& partition) {
  const MutexLock lock(mutex_);
  book_.answered(partition, Clock::now());
}

ReplyChannels::Writer ReplyChannels::writer(const std::string& participant,
                                            const std::string& partition,
                                            const std::string& topic) const {
  const auto channel = channels_.find(partition);
  if (channel == channels_.end() || !book_.listens(participant, partition)) return nullptr;
  Writer found = channel->second->writer(topic);
  return found && found->has_reader() ? found : nullptr;
}

void ReplyChannels::put(Outbox& outbox, const ReplyAddress& to, std::shared_ptr<void> reply,
                        std::size_t bytes) {
  const Parcel parcel{to.participant,   to.partition, to.topic,
                      std::move(reply), bytes,        Clock::now() + kReplyPatience};
  if (!book_.may_listen(to.participant, to.partition) || !outbox.put(parcel)) ++unheard_;
}

void ReplyChannels::send(const ReplyAddress& to, std::shared_ptr<void> reply, std::size_t bytes) {
  Writer at_hand;
  {
    const MutexLock lock(mutex_);
    at_hand = writer(to.participant, to.partition, to.topic);
    if (!at_hand) put(kept_, to, std::move(reply), bytes);
  }
  if (at_hand) write(at_hand, reply.get());
}

void ReplyChannels::post(const ReplyAddress& to, std::shared_ptr<void> reply, std::size_t bytes) {
  {
    const MutexLock lock(mutex_);
    put(writer(to.participant, to.partition, to.topic) ? posted_ : kept_, to, std::move(reply),
        bytes);
  }
  due_.notify_all();
}

void ReplyChannels::write(const Writer& writer, void* reply) {
  const WorkUnderWay::Piece piece = writing_.begin();
  if (!writer->write(reply)) ++unheard_;
}

void ReplyChannels::add_ready(std::list<Parcel> parcels, std::vector<Ready>* ready) {
  for (Parcel& parcel : parcels) {
    Writer to = writer(parcel.client, parcel.partition, parcel.topic);
    if (to) {
      ready->push_back({std::move(to), std::move(parcel.reply)});
    } else if (!kept_.put(std::move(parcel))) {
      ++unheard_;
    }
  }
}

std::vector<ReplyChannels::Ready> ReplyChannels::wait_for_ready(const std::stop_token& stop) {
  MutexLock lock(mutex_);
  due_.wait_for(lock, stop, kLook,
                [this]() TRAMMEL_REQUIRES(mutex_) { return has_matched_ || !posted_.empty(); });
  unheard_ += kept_.expire(Clock::now());
  std::vector<Ready> ready;
  if (has_matched_) {
    add_ready(kept_.take(kWrittenAtOnce,
                         [this](const Parcel& one) TRAMMEL_REQUIRES(mutex_) {
                           return writer(one.client, one.partition, one.topic) != nullptr;
                         }),
              &ready);
    has_matched_ = ready.size() == kWrittenAtOnce;
  }
  add_ready(posted_.take(kWrittenAtOnce, [](const Parcel&) { return true; }), &ready);
  return ready;
}

void ReplyChannels::deliver(const std::stop_token& stop) {
  ::pthread_setname_np(::pthread_self(), "replies");
  bool is_last = false;
  while (!is_last) {
    is_last = stop.stop_requested();
    std::vector<Ready> ready = wait_for_ready(stop);
    is_last = is_last && ready.empty();
    for (const Ready& each : ready) write(each.writer, each.reply.get());
    ++looks_;
  }
}

std::size_t ReplyChannels::clients() const {
  const MutexLock lock(mutex_);
  return book_.open();
}

}  // namespace trammel
