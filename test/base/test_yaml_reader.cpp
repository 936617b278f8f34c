// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <functional>

#include "base/yaml.hpp"
#include "dynid/base/error.hpp"

namespace dynid::detail {
namespace {

YamlItem read(const std::string& text) {
  return YamlItem::document("format: f-1\n" + text, "f.yaml", "f-1", "a test");
}

std::string error_of(const std::function<void()>& act) {
  try {
    act();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

std::string error_of(const std::string& text, const std::function<void(const YamlItem&)>& act) {
  return error_of([&] { act(read(text)); });
}

TEST(YamlReader, ReadsWhatThereIs) {
  const YamlItem root = read("a: {n: +1.5, i: -3, b: true, t: '', l: [1, 2], v: [1, 2, 3]}\n");
  const YamlItem a = root.at("a");
  EXPECT_EQ(a.at("n").number(), 1.5);
  EXPECT_EQ(a.at("i").integer(), -3);
  EXPECT_TRUE(a.at("b").boolean());
  EXPECT_EQ(a.at("t").text(), "");
  EXPECT_EQ(a.at("l").interval(), std::make_pair(1.0, 2.0));
  EXPECT_EQ(a.at("v").vector<3>(), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(a.at("v").list().size(), 3u);
  EXPECT_EQ(a.entries().front().first, "n");
  EXPECT_FALSE(a.has("x"));
  EXPECT_FALSE(a.at("n").has("x"));  // a number has no keys
}

// Whatever is wrong, the line says file, line and key.
TEST(YamlReader, EveryFaultIsNamedWithItsPlace) {
  const auto value = [](const char* key) { return [key](const YamlItem& r) { r.at("a").at(key).number(); }; };
  EXPECT_EQ(error_of("a:\n  k: 1\n", value("x")), "f.yaml:3: a.x: missing");
  EXPECT_EQ(error_of("a: {x: [1]}\n", value("x")), "f.yaml:2: a.x: expected a number, found a list");
  EXPECT_EQ(error_of("a: {x: }\n", value("x")), "f.yaml:2: a.x: expected a number, found nothing");
  EXPECT_EQ(error_of("a: 5\n", value("x")), "f.yaml:2: a: expected a map, found a single value");
  for (const char* bad : {"nan", ".nan", ".inf", "1e999", "one", "0x1"})
    EXPECT_EQ(error_of(std::string("a: {x: ") + bad + "}\n", value("x")),
              std::string("f.yaml:2: a.x: expected a finite number, found '") + bad + "'");
  const auto keys = [](const YamlItem& r) { r.at("a").expect_keys({"x", "y"}); };
  EXPECT_EQ(error_of("a: {x: 1, z: 2}\n", keys), "f.yaml:2: a: unknown key 'z'");
  EXPECT_EQ(error_of("a: {x: 1,\n  x: 2}\n", keys), "f.yaml:3: a: key 'x' appears twice");
  EXPECT_EQ(error_of("a: {[1]: 1}\n", keys), "f.yaml:2: a: a key is not a word");
  EXPECT_EQ(error_of("a: [1]\n", keys), "f.yaml:2: a: expected a map, found a list");
  EXPECT_EQ(error_of("a: {x: 1, x: 2}\n", [](const YamlItem& r) { r.at("a").entries(); }),
            "f.yaml:2: a: key 'x' appears twice");
  const auto list = [](const YamlItem& r) { r.at("a").list().at(1).positive_number(); };
  EXPECT_EQ(error_of("a: {x: 1}\n", list), "f.yaml:2: a: expected a list, found a map");
  EXPECT_EQ(error_of("a:\n  - 1\n  - 0\n", list), "f.yaml:4: a[2]: expected a positive number, found 0");
  const auto integer = [](const YamlItem& r) { r.at("a").integer(); };
  EXPECT_EQ(error_of("a: 1.5\n", integer), "f.yaml:2: a: expected a whole number, found '1.5'");
  EXPECT_EQ(error_of("a: 1e10\n", integer), "f.yaml:2: a: expected a whole number, found '1e10'");
  EXPECT_EQ(error_of("a: yes\n", [](const YamlItem& r) { r.at("a").boolean(); }),
            "f.yaml:2: a: expected true or false, found 'yes'");
  EXPECT_EQ(error_of("a: ''\n", [](const YamlItem& r) { r.at("a").name(); }),
            "f.yaml:2: a: expected a name, found an empty text");
  const auto vector = [](const YamlItem& r) { r.at("a").vector<3>(); };
  EXPECT_EQ(error_of("a: [1, 2]\n", vector), "f.yaml:2: a: expected 3 numbers, found 2");
  EXPECT_EQ(error_of("a: [1, 2, x]\n", vector), "f.yaml:2: a[3]: expected a finite number, found 'x'");
  const auto interval = [](const YamlItem& r) { r.at("a").interval(); };
  EXPECT_EQ(error_of("a: [1]\n", interval), "f.yaml:2: a: expected [lower, upper]");
  EXPECT_EQ(error_of("a: [2, 1]\n", interval),
            "f.yaml:2: a: the bounds cross: the lower one is above the upper one");
}

TEST(YamlReader, ADocumentIsOneMapOfItsFormat) {
  const auto document = [](const std::string& text) {
    return error_of([&] { YamlItem::document(text, "f.yaml", "f-1", "a test"); });
  };
  EXPECT_EQ(document(""), "f.yaml: is empty, expected a test (format: f-1)");
  EXPECT_EQ(document("# nothing\n"), "f.yaml: is empty, expected a test (format: f-1)");
  EXPECT_EQ(document("- 1\n"), "f.yaml:1: expected a test (format: f-1)");
  EXPECT_EQ(document("a: 1\n"), "f.yaml:1: format: missing");
  EXPECT_EQ(document("format: f-2\n"), "f.yaml:1: format: expected f-1, found 'f-2'");
  EXPECT_EQ(document("format: f-1\n---\nformat: f-1\n"), "f.yaml:1: holds more than one document");
  EXPECT_EQ(document("format: [\n").substr(0, 7), "f.yaml:");
  EXPECT_EQ(document("format: f-1\n"), "no error");
  // No document ends where a bracket closes that none opened: yaml-cpp finds one after the other there, for
  // ever.
  for (const char* endless : {"format: f-1\n, x: 1}\n", "format: f-1\n}\n", "}\n", ", x\n"})
    EXPECT_EQ(document(endless).substr(0, 7), "f.yaml:") << endless;
  for (const char* odd :
       {"format: \"\\\n\"\n", "format: \"\\\x01\"\n", "\"for\\nmat\": 1\n", "format: \"f\\n-1\"\n"})
    EXPECT_EQ(document(odd).find('\n'), std::string::npos) << "one line: " << document(odd);
}

TEST(YamlReader, AnErrorIsLocatedOnce) {
  const auto wrapped = [](bool located) {
    return [located](const YamlItem& r) {
      r.at("a").located([&] {
        if (located) r.at("b").number();
        if (!located) throw Error("too small");
        return 0;
      });
    };
  };
  EXPECT_EQ(error_of("a: 1\nb: x\n", wrapped(false)), "f.yaml:2: a: too small");
  EXPECT_EQ(error_of("a: 1\nb: x\n", wrapped(true)), "f.yaml:3: b: expected a finite number, found 'x'");
}

}  // namespace
}  // namespace dynid::detail
