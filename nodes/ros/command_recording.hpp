// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ros/message_traits.h>
#include <ros/serialization.h>
#include <ros/time.h>

#include <cstdint>
#include <cstring>
#include <mutex>
#include <string>
#include <vector>

namespace dynid {

/// A message of any type as it came, and what its publisher says of it.
struct AnyMessage {
  std::string type, md5sum, definition;
  std::vector<std::uint8_t> bytes;
  ros::Time arrival;
};

/// The messages of a command topic, kept while a recording runs. One thread adds, any other may ask.
class CommandRecording {
 public:
  /// A message as it arrives. One of a type that CommandRows does not read is dropped and counted.
  void add(const AnyMessage& message, const ros::Time& arrival);

  void start();  ///< forgets what was recorded before
  void stop();

  struct Summary {
    std::size_t messages = 0, dropped = 0;
    std::string first_drop;  ///< why
  };
  Summary summary() const;

  std::vector<AnyMessage> messages() const;  ///< a copy

 private:
  mutable std::mutex mutex_;
  bool running_ = false;
  std::vector<AnyMessage> messages_;
  std::size_t dropped_ = 0;
  std::string first_drop_;
};

}  // namespace dynid

// A subscriber to it takes every type, a bag is given the type that came: `*` stands for any with roscpp.
namespace ros {
namespace message_traits {

template <>
struct IsMessage<dynid::AnyMessage> : TrueType {};
template <>
struct MD5Sum<dynid::AnyMessage> {
  static const char* value() { return "*"; }
  static const char* value(const dynid::AnyMessage& m) { return m.md5sum.c_str(); }
};
template <>
struct DataType<dynid::AnyMessage> {
  static const char* value() { return "*"; }
  static const char* value(const dynid::AnyMessage& m) { return m.type.c_str(); }
};
template <>
struct Definition<dynid::AnyMessage> {
  static const char* value() { return ""; }
  static const char* value(const dynid::AnyMessage& m) { return m.definition.c_str(); }
};

}  // namespace message_traits

namespace serialization {

template <>
struct Serializer<dynid::AnyMessage> {
  template <typename Stream>
  static void write(Stream& stream, const dynid::AnyMessage& m) {
    if (!m.bytes.empty()) std::memcpy(stream.advance(serializedLength(m)), m.bytes.data(), m.bytes.size());
  }
  template <typename Stream>
  static void read(Stream& stream, dynid::AnyMessage& m) {
    m.bytes.assign(stream.getData(), stream.getData() + stream.getLength());
  }
  static std::uint32_t serializedLength(const dynid::AnyMessage& m) {
    return static_cast<std::uint32_t>(m.bytes.size());
  }
};
template <>
struct PreDeserialize<dynid::AnyMessage> {
  static void notify(const PreDeserializeParams<dynid::AnyMessage>& params) {
    const M_string& header = *params.connection_header;
    const auto of = [&](const char* key) {
      const auto at = header.find(key);
      return at == header.end() ? std::string() : at->second;
    };
    params.message->type = of("type");
    params.message->md5sum = of("md5sum");
    params.message->definition = of("message_definition");
  }
};

}  // namespace serialization
}  // namespace ros
