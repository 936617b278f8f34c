// SPDX-License-Identifier: Apache-2.0
#include "ros/bag.hpp"

#include <rosbag/bag.h>
#include <rosbag/chunked_file.h>
#include <unistd.h>

#include <algorithm>
#include <boost/interprocess/file_mapping.hpp>
#include <boost/interprocess/mapped_region.hpp>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <sstream>
#include <string_view>

#include "dynid/base/error.hpp"
#include "dynid/base/file.hpp"
#include "dynid/base/text.hpp"
#include "ros/command_rows.hpp"
#include "ros/joint_state.hpp"

namespace dynid {
namespace {

using JointState = sensor_msgs::JointState;

std::string without_slash(const std::string& topic) {
  return topic.compare(0, 1, "/") == 0 ? topic.substr(1) : topic;
}

/// What a bag says about its topics.
struct Connection {
  std::string topic, type, md5sum;
};

using Types = std::map<std::string, std::string>;  // names and checksums

const Types& joint_state_type() {
  static const Types type = {
      {ros::message_traits::DataType<JointState>::value(), ros::message_traits::MD5Sum<JointState>::value()}};
  return type;
}

/// Which of the connections is read; the others are named where it is missing.
class Topic {
 public:
  Topic(const std::string& path, const std::string& name, const Types& types = joint_state_type())
      : path_(path), name_(name), types_(types) {}

  /// Throws Error where the topic is there with another type.
  bool is(const Connection& c) {
    present_.insert(c.topic);
    if (without_slash(c.topic) != without_slash(name_)) return false;
    const auto type = types_.find(c.type);
    if (type == types_.end() || (c.md5sum != "*" && c.md5sum != type->second)) {
      std::vector<std::string> names;
      for (const auto& [name, sum] : types_) names.push_back(name);
      throw Error(where() + "is " + c.type + ", not " + join(names, " or "));
    }
    return found_ = true;
  }
  /// `damage`: why the bag is not whole; empty where it is.
  [[noreturn]] void nothing(const std::string& damage) const {
    const std::string list = present_.empty() ? ", nor is any other" : "; there are " + join(present_);
    throw Error(where() + (found_ ? "has no message" : "is not in the bag" + list) +
                (damage.empty() ? "" : "; the bag is not whole (" + damage + ")"));
  }
  std::string where() const { return path_ + ": topic " + name_ + " "; }

 private:
  std::string path_, name_;
  const Types& types_;
  std::set<std::string> present_;
  bool found_ = false;
};

/// A serialised message.
struct RawMessage {
  std::string type;
  std::uint8_t* data;
  std::size_t size;
  std::int64_t arrival;  ///< [ns] when it was recorded
};
/// Throws std::runtime_error where it is damaged.
using OnMessage = std::function<void(const RawMessage&)>;

/// Throws std::runtime_error where it is damaged.
void deserialise(const RawMessage& raw, JointState& message) {
  if (!is_joint_state(raw.data, raw.size)) throw std::runtime_error("a damaged message");
  ros::serialization::IStream stream(raw.data, static_cast<std::uint32_t>(raw.size));
  ros::serialization::deserialize(stream, message);
}

/// A topic, and who reads it.
struct Listener {
  Topic& topic;
  OnMessage on_message;
};

/// The records of a bag one after the other (http://wiki.ros.org/Bags/Format/2.0), in the order in which they
/// were written; chunks are decompressed and messages deserialised by the libraries. rosbag::View is not
/// used: it goes by the index alone, so it refuses a bag that was cut short or never closed
/// (BagUnindexedException; what makes the index again, `rosbag reindex`, is a Python program), and where the
/// index is damaged it reads beyond its buffers. This ends at the first thing that is not a whole record.
class Scan {
 public:
  explicit Scan(std::vector<Listener> listeners) : listeners_(std::move(listeners)) {}

  /// What is wrong with the bag, empty where it is whole. Throws Error where the file is no bag at all.
  std::string file(const std::string& path) {
    namespace ipc = boost::interprocess;
    static constexpr std::string_view magic = "#ROSBAG V2.0\n";
    std::error_code error;
    const auto size = std::filesystem::file_size(path, error);
    if (error) throw Error(path + ": cannot read: " + error.message());
    if (size < magic.size()) throw Error(path + ": not a bag: " + std::to_string(size) + " bytes");
    const ipc::file_mapping file(path.c_str(), ipc::read_only);
    const ipc::mapped_region region(file, ipc::read_only);
    const std::string_view bytes(static_cast<const char*>(region.get_address()), region.get_size());
    if (bytes.substr(0, magic.size()) != magic)
      throw Error(path + ": not a bag of format 2.0 (its first line is not #ROSBAG V2.0)");
    try {
      if (!records(bytes.substr(magic.size()))) return "it is cut short or damaged";
    } catch (const Error&) {
      throw;
    } catch (const std::exception& damage) {  // rosbag's, of many types
      return damage.what();
    }
    if (index_ == 0) return "it has no index: it was never closed";
    return chunks_ == chunks_listed_ ? "" : "it is cut short";
  }

 private:
  using Fields = std::map<std::string_view, std::string_view>;

  /// Length and bytes; false where they are cut off.
  static bool take(std::string_view& bytes, std::string_view& out) {
    std::uint32_t length = 0;
    if (!number(bytes, length) || bytes.size() - sizeof length < length) return false;
    out = bytes.substr(sizeof length, length);
    bytes.remove_prefix(sizeof length + length);
    return true;
  }
  template <class T>
  static bool number(std::string_view bytes, T& out) {
    if (bytes.size() < sizeof out) return false;
    std::memcpy(&out, bytes.data(), sizeof out);
    return true;
  }
  static bool parse(std::string_view header, Fields& fields) {
    fields.clear();
    std::string_view field;
    while (!header.empty()) {
      if (!take(header, field)) return false;
      const std::size_t equals = field.find(static_cast<char>(rosbag::FIELD_DELIM));
      if (equals == std::string_view::npos) return false;
      fields[field.substr(0, equals)] = field.substr(equals + 1);
    }
    return true;
  }

  /// False where they end in something that is not a record.
  bool records(std::string_view bytes) {
    Fields fields;
    std::string_view header, data;
    while (!bytes.empty()) {
      unsigned char op = 0;
      if (!take(bytes, header) || !parse(header, fields) || !number(fields[rosbag::OP_FIELD_NAME], op))
        return false;
      if (op == rosbag::OP_CHUNK) ++chunks_;
      if (op == rosbag::OP_CHUNK_INFO) ++chunks_listed_;
      const std::string_view compression = fields[rosbag::COMPRESSION_FIELD_NAME];
      if (op == rosbag::OP_CHUNK && compression == rosbag::COMPRESSION_NONE) {
        // Its records follow as they are: one after the other, even where the chunk is cut off, or its length
        // is still the 0 with which it was begun.
        if (bytes.size() < sizeof(std::uint32_t)) return false;
        bytes.remove_prefix(sizeof(std::uint32_t));
        continue;
      }
      if (!take(bytes, data)) return false;
      if (op == rosbag::OP_FILE_HEADER) {
        if (!fields[rosbag::ENCRYPTOR_FIELD_NAME].empty()) throw std::runtime_error("it is encrypted");
        number(fields[rosbag::INDEX_POS_FIELD_NAME], index_);
      } else if (op == rosbag::OP_CHUNK) {
        std::uint32_t size = 0;
        if (!number(fields[rosbag::SIZE_FIELD_NAME], size) || !chunk(compression, data, size)) return false;
      } else if (op == rosbag::OP_CONNECTION) {
        if (!connection(fields, data)) return false;
      } else if (op == rosbag::OP_MSG_DATA) {
        std::uint32_t id = 0;
        if (!number(fields[rosbag::CONNECTION_FIELD_NAME], id)) return false;
        const auto ours = ours_.find(id);
        if (ours == ours_.end()) continue;
        std::uint32_t time[2] = {0, 0};  // [s, ns]
        const std::string_view stamp = fields[rosbag::TIME_FIELD_NAME];
        if (stamp.size() == sizeof time) std::memcpy(time, stamp.data(), sizeof time);
        buffer_.assign(data.begin(), data.end());
        listeners_[ours->second.listener].on_message(
            {ours->second.type, buffer_.data(), buffer_.size(),
             std::int64_t(time[0]) * 1000000000 + std::int64_t(time[1])});
      } else if (op != rosbag::OP_INDEX_DATA && op != rosbag::OP_CHUNK_INFO) {
        return false;
      }
    }
    return true;
  }

  bool chunk(std::string_view compression, std::string_view data, std::uint32_t size) {
    const bool bz2 = compression == rosbag::COMPRESSION_BZ2;
    if (!bz2 && compression != rosbag::COMPRESSION_LZ4) return false;
    // A damaged length can be anything: no more bytes than there can be, and no chunk within a chunk.
    constexpr std::uint32_t most = 1u << 30;
    const double ratio = bz2 ? 1048576.0 : 256.0;  // of zeros
    if (within_chunk_ || data.empty() || size > std::min(double(most), ratio * double(data.size())))
      return false;
    std::vector<std::uint8_t> in(data.begin(), data.end()), out(size);
    rosbag::ChunkedFile().decompress(bz2 ? rosbag::compression::BZ2 : rosbag::compression::LZ4, out.data(),
                                     size, in.data(), static_cast<unsigned>(in.size()));
    within_chunk_ = true;
    const bool whole = records({reinterpret_cast<const char*>(out.data()), out.size()});
    within_chunk_ = false;
    return whole;
  }

  bool connection(Fields& fields, std::string_view data) {
    std::uint32_t id = 0;
    if (!number(fields[rosbag::CONNECTION_FIELD_NAME], id)) return false;
    const std::string name(fields[rosbag::TOPIC_FIELD_NAME]);
    Fields about;
    if (!parse(data, about)) return false;
    const Connection connection = {name, std::string(about["type"]), std::string(about["md5sum"])};
    for (std::size_t k = 0; k < listeners_.size(); ++k)
      if (listeners_[k].topic.is(connection)) ours_[id] = {k, connection.type};
    return true;
  }

  struct Ours {
    std::size_t listener;
    std::string type;
  };
  std::vector<Listener> listeners_;
  std::map<std::uint32_t, Ours> ours_;   // connections
  std::uint64_t index_ = 0;              // where it begins; 0 until the bag is closed
  long chunks_ = 0, chunks_listed_ = 0;  // met, and in the index
  bool within_chunk_ = false;            // that was compressed
  std::vector<std::uint8_t> buffer_;
};

/// The rows of a log, message by message.
class Rows {
 public:
  Rows(const Topic& topic, const std::vector<std::string>& joints) : where_(topic.where()), reader_(joints) {}

  void add(const JointState& message, std::int64_t arrival) {
    ++messages_;
    for (const std::string& name : message.name)
      if (names_.size() < 20) names_.insert(name);
    try {
      if (!reader_.read(message)) return;
      if (samples() == 0) first_ = message.header.stamp;
      const std::int64_t stamp = nanoseconds(message.header.stamp);
      if (samples() > 0 && stamp < t_.back()) {
        std::ostringstream text;
        text << "time goes back from " << seconds(t_.back()) << " s to " << seconds(stamp) << " s";
        throw Error(text.str());
      }
      append("velocity", reader_.dq(), dq_);
      append("effort", reader_.tau(), tau_);
      append("position", reader_.q(), q_);
      t_.push_back(stamp);
      arrivals_.push_back(arrival);
    } catch (const Error& error) {
      throw Error(where_ + "message " + std::to_string(messages_) + ": " + error.what());
    }
  }

  std::size_t samples() const { return t_.size(); }
  std::size_t messages() const { return messages_; }
  double last() const { return seconds(t_.back()); }

  /// Headers have stamps; else rows can go by arrival alone.
  bool stamped() const { return samples() > 0 && !(first_.isZero() && t_.back() == 0); }
  /// [ns] of the rows.
  std::vector<std::int64_t> times(bool by_arrival) const {
    if (by_arrival) return arrivals_;
    std::vector<std::int64_t> out = t_;
    for (std::int64_t& t : out) t += std::int64_t(first_.sec) * 1000000000 + std::int64_t(first_.nsec);
    return out;
  }

  Log log(const std::string& path, const LogColumns& required, bool by_arrival = false) const {
    if (samples() == 0)
      throw Error(where_ + "has no message with joint '" + reader_.joints().front() +
                  "' or another of the robot's; there are " + (names_.empty() ? "no names" : join(names_)));
    if (!stamped() && !by_arrival) throw Error(where_ + "has no stamps: header.stamp is 0");
    Log log;
    log.source = path;
    log.t.resize(static_cast<Eigen::Index>(t_.size()));
    for (std::size_t i = 0; i < t_.size(); ++i)
      log.t[static_cast<Eigen::Index>(i)] = seconds(by_arrival ? arrivals_[i] - arrivals_[0] : t_[i]);
    log.q = matrix(q_);
    log.dq = matrix(dq_);
    log.tau = matrix(tau_);
    if (required.dq && log.dq.size() == 0) throw Error(where_ + "has no velocity (it is needed as dq)");
    if (required.tau && log.tau.size() == 0) throw Error(where_ + "has no effort (it is needed as tau)");
    return log;
  }

 private:
  /// Since the first message: below 100 days exact as a double.
  std::int64_t nanoseconds(const ros::Time& stamp) const {
    return (std::int64_t(stamp.sec) - std::int64_t(first_.sec)) * 1000000000 + std::int64_t(stamp.nsec) -
           std::int64_t(first_.nsec);
  }
  /// The double nearest the decimal number.
  static double seconds(std::int64_t ns) { return double(ns) / 1e9; }

  void append(const char* what, const Eigen::VectorXd& x, std::vector<double>& all) const {
    if (samples() > 0 && all.empty() != (x.size() == 0))
      throw Error(std::string(what) +
                  (all.empty() ? " is sent here, not before" : " is empty here, not before"));
    all.insert(all.end(), x.begin(), x.end());
  }
  Eigen::MatrixXd matrix(const std::vector<double>& rows) const {
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    if (rows.empty()) return {};
    return Eigen::Map<const RowMajor>(rows.data(), static_cast<Eigen::Index>(samples()),
                                      static_cast<Eigen::Index>(reader_.joints().size()));
  }

  std::string where_;
  JointStateReader reader_;
  std::size_t messages_ = 0;
  ros::Time first_;
  std::vector<std::int64_t> t_;  // [ns] since first_
  std::vector<std::int64_t> arrivals_;
  std::vector<double> q_, dq_, tau_;  // rows one after the other
  std::set<std::string> names_;       // some of those seen
};

/// A file of its own for as long as it lives.
class TemporaryFile {
 public:
  TemporaryFile() : path_((std::filesystem::temp_directory_path() / "dynid-bag-XXXXXX").string()) {
    const int descriptor = ::mkstemp(path_.data());
    if (descriptor < 0) throw Error(path_ + ": cannot be made: " + std::strerror(errno));
    ::close(descriptor);
  }
  ~TemporaryFile() { ::unlink(path_.c_str()); }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

void check_readable(const std::string& path) {
  if (::access(path.c_str(), R_OK) != 0) throw Error(path + ": cannot read: " + std::strerror(errno));
}

void warn_of(const std::string& path, const std::string& damage, const Rows& rows, std::string* warning) {
  if (warning == nullptr) return;
  warning->clear();
  if (damage.empty()) return;
  std::ostringstream text;
  text << path << ": the bag is not whole (" << damage << "): " << rows.samples()
       << " messages could be read, up to " << rows.last() << " s";
  *warning = text.str();
}

Listener into(Rows& rows, Topic& topic) {
  return {topic, [&rows, message = JointState()](const RawMessage& raw) mutable {
            deserialise(raw, message);
            rows.add(message, raw.arrival);
          }};
}

}  // namespace

Log read_bag(const std::string& path, const std::vector<std::string>& joints, const std::string& topic,
             const LogColumns& required, std::string* warning) {
  check_readable(path);
  Topic wanted(path, topic);
  Rows rows(wanted, joints);
  const std::string damage = Scan({into(rows, wanted)}).file(path);
  if (rows.messages() == 0) wanted.nothing(damage);
  Log log = rows.log(path, required);
  warn_of(path, damage, rows, warning);
  return log;
}

Log read_servo_bag(const std::string& path, const std::vector<std::string>& joints, const std::string& topic,
                   const std::string& command_topic, const LogColumns& required, std::string* warning) {
  check_readable(path);
  if (without_slash(topic) == without_slash(command_topic))
    throw Error(path + ": topic " + topic + " cannot be both what is commanded and what is measured");
  Topic states(path, topic), commanded(path, command_topic, CommandRows::types());
  Rows rows(states, joints);
  CommandRows commands(joints);
  const auto command = [&](const RawMessage& raw) {
    try {
      commands.add(raw.type, raw.data, raw.size, raw.arrival);
    } catch (const Error& error) {
      throw Error(commanded.where() + error.what());
    }
  };
  const std::string damage = Scan({into(rows, states), {commanded, command}}).file(path);
  if (rows.messages() == 0) states.nothing(damage);
  if (commands.messages() == 0) commanded.nothing(damage);
  const bool by_arrival = !rows.stamped() || !commands.stamped();
  Log log = rows.log(path, required, by_arrival);
  Eigen::Index unheard = 0;
  log.u = commands.at(rows.times(by_arrival), by_arrival, unheard);
  const Eigen::Index left = log.samples() - unheard;
  if (left < 2) throw Error(commanded.where() + "says nothing before the joint states end");
  // Rows before the first command have none.
  log.t = (log.t.tail(left).array() - log.t[unheard]).eval();
  for (Eigen::MatrixXd* m : {&log.q, &log.dq, &log.tau, &log.u})
    if (m->size() > 0) *m = m->bottomRows(left).eval();
  warn_of(path, damage, rows, warning);
  return log;
}

namespace {

/// A bag that `fill` fills, whole or not at all.
void write_whole(const std::string& path, BagCompression compression,
                 const std::function<void(rosbag::Bag&)>& fill) {
  check_writable(path);
  const TemporaryFile temporary;
  try {
    rosbag::Bag bag(temporary.path(), rosbag::bagmode::Write);
    bag.setCompression(compression == BagCompression::bz2   ? rosbag::compression::BZ2
                       : compression == BagCompression::lz4 ? rosbag::compression::LZ4
                                                            : rosbag::compression::Uncompressed);
    fill(bag);
    bag.close();
  } catch (const std::exception& error) {
    throw Error(path + ": cannot write: " + error.what());
  }
  write_file(path, read_file(temporary.path()));
}

}  // namespace

void write_bag(const std::string& path, const std::vector<JointState>& messages, const std::string& topic,
               BagCompression compression) {
  write_whole(path, compression, [&](rosbag::Bag& bag) {
    ros::Time at = ros::TIME_MIN;  // when it was written: never back
    for (const JointState& message : messages) {
      at = std::max(at, message.header.stamp);
      bag.write(topic, at, message);
    }
  });
}

void write_servo_bag(const std::string& path, const std::vector<JointState>& messages,
                     const std::vector<ros::Time>& arrivals, const std::string& topic,
                     const std::vector<AnyMessage>& commands, const std::string& command_topic,
                     BagCompression compression) {
  if (arrivals.size() != messages.size())
    throw Error(path + ": " + std::to_string(arrivals.size()) + " arrivals of " +
                std::to_string(messages.size()) + " messages");
  write_whole(path, compression, [&](rosbag::Bag& bag) {
    std::size_t next = 0;  // of the commands: records stand in the order in which they came
    const auto commands_until = [&](const ros::Time& time) {
      for (; next < commands.size() && commands[next].arrival <= time; ++next)
        bag.write(command_topic, std::max(commands[next].arrival, ros::TIME_MIN), commands[next]);
    };
    for (std::size_t k = 0; k < messages.size(); ++k) {
      commands_until(arrivals[k]);
      bag.write(topic, std::max(arrivals[k], ros::TIME_MIN), messages[k]);
    }
    commands_until(ros::TIME_MAX);
  });
}

void write_bag(const std::string& path, const Log& log, const std::vector<std::string>& joints,
               const std::string& topic, BagCompression compression) {
  const Eigen::Index n = log.samples();
  if (static_cast<int>(joints.size()) != log.joints())
    throw Error(path + ": " + std::to_string(joints.size()) + " joint names for " +
                std::to_string(log.joints()) + " joints");
  if (log.t.size() != n || n == 0) throw Error(path + ": a bag needs the time of every sample");
  for (const Eigen::MatrixXd* x : {&log.dq, &log.tau})
    if (x->size() != 0 && (x->rows() != n || x->cols() != log.q.cols()))
      throw Error(path + ": q, dq and tau of the log have different sizes");
  const auto row = [](const Eigen::MatrixXd& x, Eigen::Index i) {
    const Eigen::VectorXd values = x.size() > 0 ? Eigen::VectorXd(x.row(i)) : Eigen::VectorXd();
    return std::vector<double>(values.begin(), values.end());
  };
  std::vector<JointState> messages(static_cast<std::size_t>(n));
  for (Eigen::Index i = 0; i < n; ++i) {
    JointState& message = messages[static_cast<std::size_t>(i)];
    const std::int64_t stamp = 1000000000 + std::llround(1e9 * (log.t[i] - log.t[0]));
    message.header.seq = static_cast<std::uint32_t>(i);
    message.header.stamp.fromNSec(static_cast<std::uint64_t>(stamp));
    message.name = joints;
    message.position = row(log.q, i);
    message.velocity = row(log.dq, i);
    message.effort = row(log.tau, i);
  }
  write_bag(path, messages, topic, compression);
}

}  // namespace dynid
