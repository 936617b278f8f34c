// SPDX-License-Identifier: Apache-2.0
#include "dynid/retrieval/bounds.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>

#include "../../src/retrieval/differences.hpp"
#include "dynid/base/error.hpp"
#include "dynid/retrieval/shape.hpp"

namespace dynid {
namespace {

namespace fs = std::filesystem;

class Folder {
 public:
  Folder() {
    std::string name = (fs::temp_directory_path() / "dynid_bounds_XXXXXX").string();
    path_ = mkdtemp(name.data());
  }
  ~Folder() { fs::remove_all(path_); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path_ + "/" + name, std::ios::binary) << text;
    return path_ + "/" + name;
  }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

const std::string link_text =
    "  - {mass: [0.1, 5], com_x: [-0.1, 0.2], com_y: [-0.3, 0.4], com_z: [-0.5, 0.6], inertia_diagonal: [0, "
    "1], "
    "inertia_off_diagonal: [-1, 1]}\n";
const std::string two_links = "format: dynid-bounds-1\nlinks:\n" + link_text + link_text;

std::string error_of(const std::string& text) {
  const Folder folder;
  try {
    read_bounds(folder.write("bounds.yaml", text));
  } catch (const Error& error) {
    const std::string what = error.what();
    EXPECT_EQ(what.find('\n'), std::string::npos) << what;
    return what;
  }
  return "";
}

#define EXPECT_ERROR(text, ...)                                                                          \
  do {                                                                                                   \
    const std::string what = error_of(text);                                                             \
    for (const std::string& part : {__VA_ARGS__}) EXPECT_NE(what.find(part), std::string::npos) << what; \
  } while (false)

TEST(Bounds, EveryKeyIsRead) {
  const Folder folder;
  const Bounds bounds = read_bounds(folder.write(
      "bounds.yaml",
      two_links + "total_mass: [1, 9]\nconstraints:\n  - {name: heavy, expression: m1 - m2}\n" +
          "  - {name: told, expression: c1x - 1, enforce: false}\n" +
          "  - {name: there, expression: 1 - m2, when: c1x}\nshapes:\n" +
          "  - {link: 2, solids: [{type: cylinder, from: [0, 0, 0], to: [0, 0, 1], radius: 0.1},\n" +
          "                       {type: sphere, xyz: [0, 0, 1], radius: 0.2}]}\n"));
  ASSERT_EQ(bounds.links(), 2);
  Eigen::VectorXd lower(10), upper(10);
  lower << 0.1, -0.1, -0.3, -0.5, 0, -1, 0, -1, -1, 0;
  upper << 5, 0.2, 0.4, 0.6, 1, 1, 1, 1, 1, 1;
  EXPECT_EQ(bounds.lower.tail(10), lower);
  EXPECT_EQ(bounds.upper.head(10), upper);
  EXPECT_EQ(bounds.total_mass_lower, 1.0);
  EXPECT_EQ(bounds.total_mass_upper, 9.0);
  ASSERT_EQ(bounds.constraints.size(), 4u);
  Eigen::VectorXd p = Eigen::VectorXd::Zero(20);
  p[0] = 3.0;
  p[10] = 2.0;
  p[13] = 1.15;
  EXPECT_EQ(bounds.constraints[0].margin(p), 1.0);
  EXPECT_FALSE(bounds.constraints[1].enforced);
  EXPECT_LT(bounds.constraints[2].margin(p), 0.0);  // c1x = 0 counts as there
  p[1] = -0.1;
  EXPECT_GE(bounds.constraints[2].margin(p), 0.0);
  EXPECT_NEAR(bounds.constraints[3].margin(p), 0.05, 1e-12);  // in the sphere, beyond the cylinder
}

TEST(Bounds, ThePandasFileIsTheLetters) {
  const Bounds bounds = read_bounds(std::string(DYNID_SOURCE_DIR) + "/config/panda_bounds.yaml");
  ASSERT_EQ(bounds.links(), 7);
  EXPECT_EQ(bounds.total_mass_lower, 16.0);
  EXPECT_EQ(bounds.total_mass_upper, 20.0);
  EXPECT_EQ(bounds.lower[3], -0.4);
  EXPECT_EQ(bounds.upper[32], 0.15);
  EXPECT_EQ(bounds.lower[63], 0.04);
}

// Every fault is named with the file, its line and the key, before anything is optimised.
TEST(Bounds, FaultsAreNamed) {
  EXPECT_ERROR("links: []\n", std::string("bounds.yaml"), std::string("format"));
  EXPECT_ERROR("format: dynid-bounds-2\n" + two_links.substr(23), std::string("bounds.yaml:1"),
               std::string("format"));
  EXPECT_ERROR(two_links + "masses: [1, 2]\n", std::string("bounds.yaml:5"),
               std::string("unknown key 'masses'"));
  EXPECT_ERROR(two_links + "total_mass: [9, 1]\n", std::string("bounds.yaml:5"), std::string("total_mass"),
               std::string("cross"));
  EXPECT_ERROR(two_links + "total_mass: [0.1, 0.15]\n", std::string("smallest masses add up to 0.2"));
  EXPECT_ERROR(two_links + "total_mass: [20, 30]\n", std::string("largest masses add up to 10"));
  EXPECT_ERROR(two_links + "total_mass: [1, x]\n", std::string(":5"), std::string("total_mass[2]"));
  EXPECT_ERROR("format: dynid-bounds-1\nlinks:\n  - {mass: [3, 1]}\n", std::string(":3"),
               std::string("links[1].mass"), std::string("cross"));
  EXPECT_ERROR("format: dynid-bounds-1\nlinks:\n  - {mass: [1, 3]}\n", std::string("com_x"),
               std::string("missing"));
  EXPECT_ERROR("format: [\n", std::string("bounds.yaml:"));
  const std::string list = two_links + "constraints:\n";
  EXPECT_ERROR(list + "  - {name: bad, expression: m1 + }\n", std::string(":6"), std::string("'bad'"));
  EXPECT_ERROR(list + "  - {name: bad, expression: m3 - 1}\n", std::string(":6"),
               std::string("unknown name 'm3'"));
  EXPECT_ERROR(list + "  - {name: bad, expression: foo(m1)}\n", std::string(":6"), std::string("foo"));
  EXPECT_ERROR(list + "  - {name: a, expression: m1}\n  - {name: a, expression: m2}\n", std::string(":7"),
               std::string("second"));
  const std::string shape = two_links + "shapes:\n  - {link: 1, solids: [";
  EXPECT_ERROR(shape + "{type: cube}]}\n", std::string(":6"), std::string("unknown shape 'cube'"));
  EXPECT_ERROR(shape + "{type: sphere, radius: 0}]}\n", std::string(":6"), std::string("radius"));
  EXPECT_ERROR(shape + "{type: mesh, file: none.stl}]}\n", std::string(":6"), std::string("none.stl"));
  EXPECT_ERROR(shape + "{type: hull, points: [[0,0,0],[1,0,0],[0,1,0],[1,1,0]]}]}\n", std::string(":6"),
               std::string("plane"));
  EXPECT_EQ(error_of(two_links), "");
}

TEST(Bounds, InertiasThatContradictEachOtherAreNamed) {
  const Folder folder;
  Bounds bounds = read_bounds(folder.write("bounds.yaml", two_links));
  bounds.lower[4] = 0.9;
  bounds.upper[6] = bounds.upper[9] = 0.4;
  EXPECT_THROW(validate(bounds), Error);
  bounds = read_bounds(folder.write("bounds.yaml", two_links));
  bounds.lower[15] = 0.6;
  EXPECT_THROW(validate(bounds), Error);
  bounds = read_bounds(folder.write("bounds.yaml", two_links));
  for (const int k : {15, 17, 18}) bounds.lower[k] = 0.3;
  EXPECT_THROW(validate(bounds), Error);
  bounds.lower.tail(5).setConstant(0.2);  // all equal: a body can have that
  EXPECT_NO_THROW(validate(bounds));
}

// Law: an expression cut into smooth pieces is the expression.
TEST(Constraint, PiecesOfAnExpressionAgreeWithTheWhole) {
  for (const char* text : {
           "c1x > 0 ? m1 : m2",
           "(c2x >= -0.05 ? 0.08 - 0.3*(c2x + 0.2) : 0.08) - sqrt(c2y^2 + c2z^2)",
           "c1x > 0 ? (c1y < 0 ? m1 : 2*m1) : c1z <= 0.01 ? -m2 : I1xx",
           "min(c1x > 0 && c1y > 0 ? m1 : m2, c1z > 0 || c2z > 0 ? I1xy : I2yz)",
           "abs((c1x > c1y ? c1x : c1y) - 0.01)",
           "c1x == 0 ? m1 : m2",
           "m1*c1x + c2y",
       }) {
    const Constraint constraint = make_expression("c", text, 2);
    std::mt19937 generator(1);
    std::normal_distribution<double> normal;
    for (int k = 0; k < 500; ++k) {
      Eigen::VectorXd p(20);
      for (double& value : p) value = 0.1 * normal(generator);
      Constraint pieces = constraint;
      pieces.exact = nullptr;
      EXPECT_EQ(pieces.margin(p), constraint.margin(p)) << text << " at " << p.transpose();
    }
  }
  EXPECT_EQ(make_expression("c", "c1x > 0 && c1y > 0 ? m1 : m2", 1 + 1).alternatives.size(), 3u);
}

TEST(Constraint, DifferencesAreAccurate) {
  const Constraint c = make_expression("c", "m1^2 * c1x + sqrt(1 + c2y^2) * I1xx", 2);
  const Inequality& h = c.alternatives.front().required.front();
  Eigen::VectorXd p = Eigen::VectorXd::LinSpaced(20, 0.3, 0.7);
  EXPECT_EQ(h.variables, (std::vector<int>{0, 1, 4, 12}));
  const double root = std::sqrt(1 + p[12] * p[12]);
  const Eigen::Vector4d exact(2 * p[0] * p[1], p[0] * p[0], root, p[12] / root * p[4]);
  EXPECT_LT((detail::gradient(h, p) - exact).norm(), 1e-9);
  EXPECT_NEAR(detail::hessian(h, p)(0, 0), 2 * p[1], 1e-6);
  EXPECT_NEAR(detail::hessian(h, p)(3, 2), p[12] / root, 1e-6);
}

// Law: the clearance is positive inside and negative outside; the smooth inequalities agree with it in sign,
// and their derivatives with differences.
TEST(Shape, InequalitiesAgreeWithTheClearance) {
  const Eigen::Vector3d a(0.1, -0.2, 0.3), b(-0.3, 0.2, 0.1);
  Eigen::Isometry3d pose(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  pose.translation() = a;
  const std::vector<Shape> shapes = {
      Shape::box(pose, {0.1, 0.2, 0.3}), Shape::sphere(a, 0.25), Shape::cylinder(a, b, 0.15),
      Shape::truncated_cone(a, b, 0.2, 0.05),
      Shape::hull({{0, 0, 0}, {0.5, 0, 0}, {0, 0.5, 0}, {0, 0, 0.5}, {0.05, 0.05, 0.05}})};
  std::mt19937 generator(2);
  std::uniform_real_distribution<double> uniform(-0.6, 0.6);
  for (const Shape& shape : shapes) {
    const Constraint constraint = shape.contains_com("c", 2);
    int inside = 0;
    for (int k = 0; k < 2000; ++k) {
      Eigen::VectorXd p = Eigen::VectorXd::Zero(20);
      for (int i = 11; i < 14; ++i) p[i] = uniform(generator);
      const double clearance = shape.clearance(p.segment<3>(11));
      EXPECT_EQ(constraint.margin(p), clearance);
      double least = 1e300;
      for (Inequality h : constraint.alternatives.front().required) {
        least = std::min(least, h.value(p));
        const Eigen::VectorXd gradient = h.gradient(p);
        const Eigen::MatrixXd hessian = h.hessian(p);
        h.gradient = nullptr;
        EXPECT_LT((gradient - detail::gradient(h, p)).norm(), 1e-9);
        h.hessian = nullptr;
        EXPECT_LT((hessian - detail::hessian(h, p)).norm(), 1e-5);
      }
      EXPECT_EQ(clearance >= 0.0, least >= 0.0) << p.transpose();
      inside += clearance >= 0.0 ? 1 : 0;
    }
    EXPECT_GT(inside, 10);
  }
}

TEST(Shape, MeshesAreReadFromTextAndBinaryStl) {
  // A unit cube, twelve triangles.
  const Eigen::Vector3f corner[8] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0},
                                     {0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}};
  const int triangles[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                                {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  std::string text = "solid cube\n", binary(80, ' ');
  const std::uint32_t count = 12;
  binary.append(reinterpret_cast<const char*>(&count), 4);
  for (const auto& triangle : triangles) {
    text += "facet normal 0 0 0\nouter loop\n";
    binary.append(12, '\0');
    for (const int v : triangle) {
      const Eigen::Vector3f& c = corner[v];
      text += "vertex " + std::to_string(c.x()) + " " + std::to_string(c.y()) + " " + std::to_string(c.z()) +
              "\n";
      binary.append(reinterpret_cast<const char*>(c.data()), 12);
    }
    text += "endloop\nendfacet\n";
    binary.append(2, '\0');
  }
  text += "endsolid cube\n";
  const Folder folder;
  for (const std::string& file : {folder.write("text.stl", text), folder.write("binary.stl", binary)}) {
    const Shape cube = Shape::mesh(file, Eigen::Isometry3d::Identity(), {2.0, 1.0, 1.0});
    EXPECT_NEAR(cube.clearance({1.9, 0.5, 0.5}), 0.1, 1e-6) << file;
    EXPECT_NEAR(cube.clearance({1.0, 0.5, 1.25}), -0.25, 1e-6) << file;
  }
}

/// A URDF of two moving links, the second with a tool behind a fixed joint; `collision` is put into link1.
std::string urdf_with(const std::string& collision, const std::string& tool = "") {
  return "<robot name=\"r\">\n<link name=\"base\"/>\n<link name=\"link1\">" + collision +
         "</link>\n<link name=\"link2\"/>\n<link name=\"tool\">" + tool +
         "</link>\n"
         "<joint name=\"j1\" type=\"continuous\"><parent link=\"base\"/><child link=\"link1\"/>"
         "<origin xyz=\"5 5 5\"/><axis xyz=\"0 0 1\"/></joint>\n"
         "<joint name=\"j2\" type=\"continuous\"><parent link=\"link1\"/><child link=\"link2\"/>"
         "<origin xyz=\"0 0 1\" rpy=\"1 0 0\"/><axis xyz=\"0 0 1\"/></joint>\n"
         "<joint name=\"f\" type=\"fixed\"><parent link=\"link2\"/><child link=\"tool\"/>"
         "<origin xyz=\"0 0 0.5\" rpy=\"0 0 1.5707963267948966\"/></joint>\n</robot>\n";
}

std::string collision(const std::string& geometry, const std::string& xyz = "0 0 0",
                      const std::string& rpy = "0 0 0") {
  return "<collision><origin xyz=\"" + xyz + "\" rpy=\"" + rpy + "\"/><geometry>" + geometry +
         "</geometry></collision>";
}

// Law: the hull holds what its solids hold and nothing beyond the hull of their union; alone, each is exact.
TEST(Shape, CollisionGeometryOfAUrdfIsTheLinksHull) {
  const Folder folder;
  const auto shape = [&](const std::string& geometry, int link = 1, const std::string& tool = "") {
    return Shape::collision(folder.write("r.urdf", urdf_with(geometry, tool)), link);
  };
  const Shape box = shape(collision("<box size=\"0.2 0.4 0.6\"/>", "0.1 0 0", "0 0 1.5707963267948966"));
  EXPECT_NEAR(box.clearance({0.1, 0, 0}), 0.1, 1e-12);
  EXPECT_NEAR(box.clearance({0.31, 0, 0}), -0.01, 1e-12);  // 0.4 lies along x
  const Shape sphere = shape(collision("<sphere radius=\"0.3\"/>", "0 0.1 0"));
  EXPECT_NEAR(sphere.clearance({0, 0.35, 0}), 0.05, 1e-12);
  const Shape cylinder =
      shape(collision("<cylinder radius=\"0.1\" length=\"1\"/>", "0 0 0.2", "1.5707963267948966 0 0"));
  EXPECT_NEAR(cylinder.clearance({0.03, 0.4, 0.2}), 0.07, 1e-12);
  EXPECT_NEAR(cylinder.clearance({0, 0.51, 0.2}), -0.01, 1e-12);
  // A sphere and a cylinder: the capsule between them, from inside.
  const Shape both = shape(collision("<sphere radius=\"0.1\"/>", "0 0 1") +
                           collision("<cylinder radius=\"0.1\" length=\"0.2\"/>"));
  for (int k = 0; k < 500; ++k) {
    const double angle = 0.1 * k, z = 0.002 * k;
    const Eigen::Vector3d direction(std::cos(angle), std::sin(angle), 0.0);
    EXPECT_GE(both.clearance(0.098 * direction + Eigen::Vector3d(0, 0, z)), 0.0) << k;
    EXPECT_LT(both.clearance(0.1001 * direction + Eigen::Vector3d(0, 0, z)), 0.0) << k;
  }
  EXPECT_GE(both.clearance({0, 0, 1.098}), 0.0);
  EXPECT_LT(both.clearance({0, 0, -0.1001}), 0.0);
  // Link 2 has none of its own: its tool's, through the fixed joint, which turns x to y.
  const Shape tool = shape("", 2, collision("<box size=\"0.4 0.2 0.2\"/>"));
  EXPECT_NEAR(tool.clearance({0, 0.15, 0.5}), 0.05, 1e-12);
  EXPECT_NEAR(tool.clearance({0.15, 0, 0.5}), -0.05, 1e-12);
}

TEST(Shape, MeshesOfAUrdfAreFoundInTheirPackage) {
  const Folder folder;
  const std::string stl =
      "solid t\n"
      "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
      "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 1\nendloop\nendfacet\n"
      "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 0 0 1\nendloop\nendfacet\n"
      "facet normal 0 0 0\nouter loop\nvertex 1 0 0\nvertex 0 1 0\nvertex 0 0 1\nendloop\nendfacet\n"
      "endsolid t\n";
  const std::string& root = folder.path();
  fs::create_directories(root + "/arm_description/meshes");
  fs::create_directories(root + "/arm_description/urdf");
  fs::create_directories(root + "/elsewhere");
  folder.write("arm_description/meshes/t.stl", stl);
  const auto mesh = [](const std::string& name) {
    return urdf_with(collision("<mesh filename=\"" + name + "\" scale=\"2 2 2\"/>", "0 0 1"));
  };
  const auto expect_found = [](const std::string& urdf) {
    const Shape shape = Shape::collision(urdf, 1);
    EXPECT_NEAR(shape.clearance({0.1, 0.2, 1.3}), 0.1, 1e-6) << urdf;
    EXPECT_LT(shape.clearance({0.7, 0.7, 1.7}), 0.0) << urdf;
  };
  const char* set = std::getenv("ROS_PACKAGE_PATH");
  const std::string before = set ? set : "";
  unsetenv("ROS_PACKAGE_PATH");
  const std::string in_package = mesh("package://arm_description/meshes/t.stl");
  expect_found(folder.write("arm_description/urdf/a.urdf", in_package));
  expect_found(folder.write("arm_description/urdf/b.urdf", mesh("../meshes/t.stl")));
  expect_found(
      folder.write("arm_description/urdf/c.urdf", mesh("file://" + root + "/arm_description/meshes/t.stl")));
  expect_found(folder.write("d.urdf", in_package));
  const Folder other;
  const std::string outside = other.write("e.urdf", in_package);
  EXPECT_THROW(Shape::collision(outside, 1), Error);
  for (const std::string& path : {"/no/such::" + root, root + "/elsewhere:" + root + "/arm_description"}) {
    setenv("ROS_PACKAGE_PATH", path.c_str(), 1);
    expect_found(outside);
  }
  if (set)
    setenv("ROS_PACKAGE_PATH", before.c_str(), 1);
  else
    unsetenv("ROS_PACKAGE_PATH");
}

// In a bounds file: beside it, with base and tip where the tree branches; every fault in one line.
TEST(Bounds, ShapesComeFromAUrdf) {
  const Folder folder;
  const std::string shapes = two_links + "shapes:\n  - {link: 1, urdf: r.urdf";
  folder.write("r.urdf", urdf_with(collision("<box size=\"0.2 0.2 0.2\"/>")));
  const auto read = [&](const std::string& text) { return read_bounds(folder.write("b.yaml", text)); };
  const Bounds bounds = read(shapes + ", base: base, tip: tool, enforce: false}\n");
  ASSERT_EQ(bounds.constraints.size(), 1u);
  EXPECT_FALSE(bounds.constraints[0].enforced);
  Eigen::VectorXd p = Eigen::VectorXd::Zero(20);
  EXPECT_NEAR(bounds.constraints[0].margin(p), 0.1, 1e-12);
  const auto refused = [&](const std::string& text, const std::string& urdf, const std::string& part) {
    folder.write("r.urdf", urdf);
    try {
      read(text);
      ADD_FAILURE() << "taken: " << text << urdf;
    } catch (const Error& error) {
      const std::string what = error.what();
      EXPECT_NE(what.find("b.yaml:6"), std::string::npos) << what;
      EXPECT_NE(what.find(part), std::string::npos) << what;
      EXPECT_EQ(what.find('\n'), std::string::npos) << what;
    }
  };
  const std::string good = urdf_with(collision("<box size=\"0.2 0.2 0.2\"/>"));
  refused(shapes + ", solids: []}\n", good, "either solids or urdf");
  refused(two_links + "shapes:\n  - {link: 1}\n", good, "either solids or urdf");
  refused(two_links + "shapes:\n  - {link: 1, urdf: none.urdf}\n", good, "none.urdf");
  refused(two_links + "shapes:\n  - {link: 2, urdf: r.urdf, tip: link1}\n", good, "no moving link 2");
  refused(shapes + ", tip: nothing}\n", good, "unknown tip link 'nothing'");
  refused(two_links + "shapes:\n  - {link: 2, urdf: r.urdf}\n", good,
          "r.urdf:4: link 'link2': neither it nor what moves with it has collision geometry");
  refused(shapes + "}\n", urdf_with(collision("<mesh filename=\"package://p/none.stl\"/>")),
          "r.urdf:3: link 'link1': mesh 'package://p/none.stl' was not found");
  folder.write("bad.stl", "solid nothing");
  refused(shapes + "}\n", urdf_with(collision("<mesh filename=\"bad.stl\"/>")), "bad.stl");
  refused(shapes + "}\n", urdf_with(collision("<box size=\"0.2 0 0.2\"/>")), "size that is not > 0");
  refused(shapes + "}\n", urdf_with(collision("<sphere radius=\"-1\"/>")), "r.urdf");
  refused(shapes + "}\n", urdf_with(collision("<box size=\"a b c\"/>")), "r.urdf");
  refused(shapes + "}\n", urdf_with(collision("<cone/>")), "r.urdf");
  refused(shapes + "}\n", urdf_with("<collision></collision>"), "r.urdf");
}

}  // namespace
}  // namespace dynid
