// SPDX-License-Identifier: Apache-2.0
#include "hull.hpp"

#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#include <cstdio>
#include <memory>

#include "dynid/base/error.hpp"

extern "C" {
#include <libqhull_r/qhull_ra.h>
}

namespace dynid::detail {

namespace {

/// Frees what qhull holds, whatever happens.
struct Qhull {
  qhT state{};
  Qhull() { qh_zero(&state, nullptr); }
  Qhull(const Qhull&) = delete;
  Qhull& operator=(const Qhull&) = delete;
  ~Qhull() {
    int held = 0, total = 0;
    qh_freeqhull(&state, !qh_ALL);
    qh_memfreeshort(&state, &held, &total);
  }
};

void add_vertices(const aiScene& scene, const aiNode& node, const aiMatrix4x4& above,
                  std::vector<Eigen::Vector3d>& vertices) {
  const aiMatrix4x4 here = above * node.mTransformation;
  for (unsigned m = 0; m < node.mNumMeshes; ++m) {
    const aiMesh& mesh = *scene.mMeshes[node.mMeshes[m]];
    for (unsigned v = 0; v < mesh.mNumVertices; ++v) {
      const aiVector3D at = here * mesh.mVertices[v];
      vertices.emplace_back(static_cast<double>(at.x), static_cast<double>(at.y), static_cast<double>(at.z));
    }
  }
  for (unsigned k = 0; k < node.mNumChildren; ++k) add_vertices(scene, *node.mChildren[k], here, vertices);
}

}  // namespace

std::vector<std::pair<Eigen::Vector3d, double>> hull_planes(const std::vector<Eigen::Vector3d>& points) {
  if (points.size() < 4) throw Error("convex hull: at least four points are needed");
  std::vector<double> coordinates;
  for (const Eigen::Vector3d& point : points) {
    if (!point.allFinite()) throw Error("convex hull: a point is not finite");
    coordinates.insert(coordinates.end(), point.data(), point.data() + 3);
  }
  Qhull qhull;
  char options[] = "qhull Pp";
  // Qhull writes its complaints to a stream: one line of our own says enough.
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> silent(std::tmpfile(), std::fclose);
  if (qh_new_qhull(&qhull.state, 3, static_cast<int>(points.size()), coordinates.data(), 0, options, nullptr,
                   silent.get()) != 0)
    throw Error("convex hull: the points lie in one plane");
  std::vector<std::pair<Eigen::Vector3d, double>> planes;
  qhT* qh = &qhull.state;  // read by the macro
  facetT* facet = nullptr;
  FORALLfacets {
    const Eigen::Vector3d normal(facet->normal[0], facet->normal[1], facet->normal[2]);
    // Facets that were cut into triangles share a plane.
    if (!planes.empty() && planes.back().first == normal && planes.back().second == -facet->offset) continue;
    planes.emplace_back(normal, -facet->offset);
  }
  return planes;
}

std::vector<Eigen::Vector3d> mesh_vertices(const std::string& path) {
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile(path, aiProcess_JoinIdenticalVertices);
  if (scene == nullptr || scene->mRootNode == nullptr)
    throw Error(path + ": the mesh cannot be read: " + importer.GetErrorString());
  std::vector<Eigen::Vector3d> vertices;
  add_vertices(*scene, *scene->mRootNode, aiMatrix4x4(), vertices);
  if (vertices.empty()) throw Error(path + ": the mesh has no vertices");
  return vertices;
}

}  // namespace dynid::detail
