#include "core/json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "tests/testing/files.h"

namespace sateen::json_test {
namespace {

using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;
using Json = nlohmann::json;

// The message of reading `text` with `read`; empty where all went well.
std::string MessageOf(const std::string& text, const std::function<void(JsonReader&)>& read) {
  const Json object = Json::parse(text);
  JsonReader reader(object, "rig.json");
  read(reader);
  const Status status = reader.Finish();
  EXPECT_TRUE(status || status.error().code == ErrorCode::kBadData);
  return status ? "" : status.error().message;
}

TEST(JsonReader, ReadsEveryType) {
  const Json object = Json::parse(
      R"({"x": 1.5, "n": -3, "on": true, "name": "north", "v": [1, 2.5, 3], "o": {"a": 1},
          "list": [{"a": 1}, {"a": 2}], "any": [null, {}]})");
  JsonReader reader(object, "rig.json");

  EXPECT_EQ(reader.Number("x"), 1.5);
  EXPECT_EQ(reader.Integer("n"), -3);
  EXPECT_TRUE(reader.Boolean("on"));
  EXPECT_EQ(reader.String("name"), "north");
  EXPECT_THAT(reader.Numbers("v", 3), ElementsAre(1.0, 2.5, 3.0));
  EXPECT_EQ(reader.Object("o").Integer("a"), 1);
  EXPECT_EQ(reader.Objects("list").at(1).Integer("a"), 2);
  EXPECT_TRUE(reader.Has("any"));
  reader.Ignore("any");
  EXPECT_TRUE(reader.Finish());
}

TEST(JsonReader, OptionalKeysMayBeAbsent) {
  const Json object = Json::parse(R"({"x": 1.5, "name": "a", "v": [1], "o": {}})");
  JsonReader reader(object, "rig.json");

  EXPECT_EQ(reader.OptionalNumber("x"), 1.5);
  EXPECT_EQ(reader.OptionalString("name"), "a");
  EXPECT_THAT(reader.OptionalNumbers("v", 1).value(), ElementsAre(1.0));
  EXPECT_TRUE(reader.OptionalObject("o").value().Finish());
  EXPECT_EQ(reader.OptionalNumber("x2"), std::nullopt);
  EXPECT_EQ(reader.OptionalString("name2"), std::nullopt);
  EXPECT_EQ(reader.OptionalNumbers("v2", 1), std::nullopt);
  EXPECT_FALSE(reader.OptionalObject("o2").has_value());
  EXPECT_FALSE(reader.Has("x2"));
  EXPECT_TRUE(reader.Finish());
}

TEST(JsonReader, MissingKeySaysWhatIsNeeded) {
  const auto message = [](auto read) { return MessageOf("{}", read); };
  EXPECT_EQ(message([](JsonReader& r) { r.Number("x"); }),
            "rig.json: x is missing; need a finite number");
  EXPECT_THAT(message([](JsonReader& r) { r.Integer("x"); }), EndsWith("need a whole number"));
  EXPECT_THAT(message([](JsonReader& r) { r.Boolean("x"); }), EndsWith("need true or false"));
  EXPECT_THAT(message([](JsonReader& r) { r.String("x"); }), EndsWith("need a string"));
  EXPECT_THAT(message([](JsonReader& r) { r.Numbers("x", 3); }),
              EndsWith("need an array of 3 finite numbers"));
  EXPECT_THAT(message([](JsonReader& r) { r.Object("x"); }), EndsWith("need an object"));
  EXPECT_THAT(message([](JsonReader& r) { r.Objects("x"); }), EndsWith("need an array of objects"));
}

TEST(JsonReader, WrongTypeSaysWhatWasFound) {
  const auto message = [](const std::string& value, auto read) {
    return MessageOf(R"({"x": )" + value + "}", read);
  };
  const auto number = [](JsonReader& r) { r.OptionalNumber("x"); };
  EXPECT_EQ(message(R"("up")", number), "rig.json: x is \"up\"; need a finite number");
  EXPECT_THAT(message("null", number), HasSubstr("x is null;"));
  EXPECT_THAT(message("{}", number), HasSubstr("x is an object;"));
  EXPECT_THAT(message("true", [](JsonReader& r) { r.String("x"); }), HasSubstr("x is true;"));
  EXPECT_THAT(message("1", [](JsonReader& r) { r.Boolean("x"); }), HasSubstr("x is 1;"));
  EXPECT_THAT(message("[]", [](JsonReader& r) { r.Object("x"); }), HasSubstr("is an array of 0;"));
  EXPECT_THAT(message("{}", [](JsonReader& r) { r.Objects("x"); }), HasSubstr("is an object;"));
  EXPECT_THAT(message("[{}, 7]", [](JsonReader& r) { r.Objects("x"); }),
              HasSubstr("x[1] is 7; need an object"));
  EXPECT_THAT(message("[1, 2]", [](JsonReader& r) { r.Numbers("x", 3); }),
              HasSubstr("is an array of 2; need an array of 3 finite numbers"));
  EXPECT_THAT(message("[1, \"a\"]", [](JsonReader& r) { r.OptionalNumbers("x", 2); }),
              HasSubstr("x[1] is \"a\"; need a finite number"));
}

TEST(JsonReader, IntegersMustBeWholeAndFitAnInt) {
  const auto integer = [](JsonReader& r) { r.Integer("x"); };
  EXPECT_THAT(MessageOf(R"({"x": 2147483647})", integer), IsEmpty());
  EXPECT_THAT(MessageOf(R"({"x": -2147483648})", integer), IsEmpty());
  EXPECT_THAT(MessageOf(R"({"x": 2147483648})", integer), HasSubstr("x is 2147483648;"));
  EXPECT_THAT(MessageOf(R"({"x": -2147483649})", integer), HasSubstr("need a whole number"));
  EXPECT_THAT(MessageOf(R"({"x": 18446744073709551615})", integer), HasSubstr("need a whole"));
  EXPECT_THAT(MessageOf(R"({"x": 3.5})", integer), HasSubstr("x is 3.5;"));
}

TEST(JsonReader, NumbersMustBeFinite) {
  Json object = {{"x", std::numeric_limits<double>::infinity()}};
  JsonReader reader(object, "rig.json");
  reader.Number("x");
  EXPECT_FALSE(reader.Finish());
}

TEST(JsonReader, UnknownKeyIsNamedWithTheKeysThatExist) {
  EXPECT_EQ(MessageOf(R"({"axiss": 1, "axis": 2})",
                      [](JsonReader& r) {
                        r.Number("axis");
                        r.OptionalNumber("mu");
                      }),
            "rig.json: axiss is not known here; the keys are axis, mu");
}

TEST(JsonReader, PathsReachIntoObjectsAndArrays) {
  const Json object = Json::parse(R"({"camera": {"pose": {"x": "a"}}, "lights": [{}, {"b": 1}]})");
  JsonReader reader(object, "rig.json");
  JsonReader pose = reader.Object("camera").Object("pose");
  pose.Number("x");
  std::vector<JsonReader> lights = reader.Objects("lights");
  lights[1].String("name");

  EXPECT_THAT(pose.Finish().error().message, StartsWith("rig.json: camera.pose.x is \"a\";"));
  EXPECT_THAT(lights[1].Finish().error().message,
              StartsWith("rig.json: lights[1].name is missing"));
}

TEST(JsonReader, FirstFailureIsKeptAndLaterReadsGiveDefaults) {
  const Json object = Json::parse(R"({"x": "a", "y": 2, "v": [1, 2], "o": {"a": 1}})");
  JsonReader reader(object, "rig.json");
  EXPECT_EQ(reader.Number("x"), 0.0);
  EXPECT_EQ(reader.Number("y"), 0.0);
  EXPECT_THAT(reader.Numbers("v", 2), ElementsAre(0.0, 0.0));
  reader.Require(false, "y", "is 2; need 3");

  EXPECT_THAT(reader.Finish().error().message, StartsWith("rig.json: x is"));
}

TEST(JsonReader, ObjectsAfterAFailureAreSafeToReadAndFail) {
  const Json object = Json::parse(R"({"o": 3})");
  JsonReader reader(object, "rig.json");
  JsonReader missing = reader.Object("o");

  EXPECT_EQ(missing.Number("x"), 0.0);
  EXPECT_EQ(missing.Object("deeper").Integer("y"), 0);
  EXPECT_THAT(missing.Objects("list"), IsEmpty());
  EXPECT_EQ(missing.Finish().error().message, "rig.json: o is 3; need an object");
  EXPECT_EQ(reader.Finish().error().message, "rig.json: o is 3; need an object");
}

TEST(JsonReader, TopLevelMustBeAnObject) {
  EXPECT_EQ(MessageOf("[1]", [](JsonReader&) {}),
            "rig.json: top level is an array of 1; need an object");
}

TEST(JsonReader, RequireNamesTheKey) {
  EXPECT_EQ(MessageOf(R"({"x": 7})",
                      [](JsonReader& r) { r.Require(r.Number("x") < 5, "x", "is 7; need < 5"); }),
            "rig.json: x is 7; need < 5");
}

// The message of ReadJsonFile for a file with this text, without its path.
std::string MessageOfFile(const std::string& text) {
  const testing::TempFolder folder;
  const std::filesystem::path path = folder.Path() / "rig.json";
  testing::WriteText(path, text);
  const Result<Json> file = ReadJsonFile(path, "sateen.rig", 1);
  if (file) {
    return "";
  }
  EXPECT_EQ(file.error().code, ErrorCode::kBadData);
  EXPECT_THAT(file.error().message, StartsWith(path.string() + ": "));
  return file.error().message.substr(path.string().size() + 2);
}

TEST(ReadJsonFile, ReturnsTheObjectWithoutItsSchema) {
  const testing::TempFolder folder;
  testing::WriteText(folder.Path() / "a.json", R"({"schema": "sateen.rig/1", "x": 1})");
  EXPECT_EQ(ReadJsonFile(folder.Path() / "a.json", "sateen.rig", 1).value(), Json({{"x", 1}}));
}

TEST(ReadJsonFile, RefusesOtherSchemasAndVersions) {
  EXPECT_EQ(MessageOfFile("{}"), "schema is missing; need \"schema\": \"sateen.rig/1\"");
  EXPECT_EQ(MessageOfFile("[]"),
            "top level is of type array; need an object with \"schema\": \"sateen.rig/1\"");
  EXPECT_THAT(MessageOfFile(R"({"schema": "sateen.session/1"})"),
              HasSubstr("schema is \"sateen.session/1\"; need \"sateen.rig/1\": this is another"));
  EXPECT_THAT(MessageOfFile(R"({"schema": 1})"), HasSubstr("schema is 1; need"));
  EXPECT_THAT(MessageOfFile(R"({"schema": "sateen.rig/2"})"),
              HasSubstr("schema is \"sateen.rig/2\"; this program reads \"sateen.rig/1\" only"));
  EXPECT_THAT(MessageOfFile(R"({"schema": "sateen.rig/10"})"), HasSubstr("reads"));
}

TEST(ReadJsonFile, TextThatIsNotJsonIsNamedWithItsPlace) {
  EXPECT_THAT(MessageOfFile("{\n  \"a\": 1,\n  oops\n}"),
              HasSubstr("not valid JSON: parse error at line 3"));
  EXPECT_THAT(MessageOfFile(""), HasSubstr("not valid JSON"));
  EXPECT_THAT(MessageOfFile(R"({"schema": "sateen.rig/1", "x": NaN})"),
              HasSubstr("not valid JSON"));
  EXPECT_THAT(MessageOfFile(R"({"schema": "sateen.rig/1", "x": 1e999})"), HasSubstr("1e999"));
  EXPECT_THAT(MessageOfFile(R"({"schema": "sateen.rig/1"} {})"), HasSubstr("not valid JSON"));
  EXPECT_THAT(MessageOfFile("{\"schema\": \"\xff\"}"), HasSubstr("not valid JSON"));
}

TEST(ReadJsonFile, KeyGivenTwiceInOneObjectIsAnError) {
  const auto message = [](const std::string& members) {
    return MessageOfFile(R"({"schema": "sateen.rig/1", )" + members + "}");
  };
  EXPECT_THAT(message(R"("a": {"x": 1, "y": 2, "x": 3})"),
              HasSubstr("the key \"x\" is given twice in one object"));
  EXPECT_THAT(message(R"("x": 1, "a": {"b": {}}, "x": 2)"), HasSubstr("\"x\" is given twice"));
  EXPECT_THAT(message(R"("a": {"x": 1}, "b": [{"x": 1}, {"x": 2}], "x": 3)"), IsEmpty());
}

TEST(ReadJsonFile, EndlessNestingIsAnErrorAndNotACrash) {
  const std::string deep = std::string(200'000, '[') + std::string(200'000, ']');
  EXPECT_THAT(MessageOfFile(R"({"schema": "sateen.rig/1", "a": )" + deep + "}"),
              HasSubstr("nested deeper than 64 levels"));
}

// An empty object takes two letters of text and some sixty bytes of memory.
TEST(ReadJsonFile, MillionsOfObjectsAreAnError) {
  const auto message = [](int count) {
    std::string objects;
    for (int i = 0; i < count; ++i) {
      objects += "{},";
    }
    return MessageOfFile(R"({"schema": "sateen.rig/1", "a": [)" + objects + "{}]}");
  };
  EXPECT_THAT(message(262'139), IsEmpty());  // with 2 keys, an object, an array and the last
  EXPECT_THAT(message(262'140), HasSubstr("has more than 262144 keys, objects and arrays"));
}

TEST(ReadJsonFile, MissingFileIsAnIoError) {
  const Result<Json> file = ReadJsonFile("/nowhere/rig.json", "sateen.rig", 1);
  ASSERT_FALSE(file);
  EXPECT_EQ(file.error().code, ErrorCode::kIo);
}

}  // namespace
}  // namespace sateen::json_test
