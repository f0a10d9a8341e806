// SPDX-License-Identifier: Apache-2.0
#include <core/error.h>
#include <core/rng.h>
#include <scenegraph/procedural/generators.h>
#include <scenegraph/procedural/noise.h>
#include <scenegraph/procedural/terrain_erosion.h>

namespace stipple {

namespace {

enum class TerrainStyle { kMeadow, kForestFloor, kMountain };

TerrainStyle terrainStyle(const std::string& name) {
    if (name == "meadow") return TerrainStyle::kMeadow;
    if (name == "forest_floor") return TerrainStyle::kForestFloor;
    if (name == "mountain") return TerrainStyle::kMountain;
    throw Error(ErrorCode::kInvalidArgument, "",
                "unknown terrain style '" + name + "' (meadow, forest_floor or mountain)");
}

void check(const TerrainParams& params) {
    if (params.resolution < 2 || params.resolution > 16385) {
        throw Error(ErrorCode::kInvalidArgument, "", "a terrain's resolution must be in 2..16385");
    }
    if (!(params.size > 0.0 && params.size <= 1e7 && params.relief >= 0.0 && params.relief <= 1e5 &&
          params.feature_size >= 1e-3 && params.feature_size <= 1e7)) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "a terrain's size, relief and feature_size must be positive and at most 1e7, "
                    "1e5 and 1e7 metres");
    }
    if (!(params.erosion >= 0.0 && params.erosion <= 1.0))
        throw Error(ErrorCode::kInvalidArgument, "", "a terrain's erosion must be in 0..1");
    if (!(params.water_level >= 0.0 && params.water_level <= 1e5)) {
        throw Error(ErrorCode::kInvalidArgument, "",
                    "a terrain's water_level must be in 0..100000 metres");
    }
}

// Sum of octaves in which steep places get less of the finer ones: smooth slopes and rough crests
// and hollows, as erosion leaves them. Based on: Quilez. Value noise derivatives. 2008. In about
// [-1, 1].
double erodedNoise(uint64_t key, DVec2 p, int octaves) {
    double sum = 0.0, height = 0.5;
    DVec2 slope(0.0);
    for (int i = 0; i < octaves; ++i) {
        const NoiseSample n = gradientNoise(key + uint64_t(i), p);
        slope += n.derivative * 0.5;
        sum += height * n.value / (1.0 + glm::dot(slope, slope));
        height *= 0.5;
        p = DVec2(1.6 * p.x + 1.2 * p.y, -1.2 * p.x + 1.6 * p.y);  // twice as fine, turned
    }
    return sum;
}

// Crests and valleys: octaves of 1 - |noise| with the crest a little rounded, finer ones only on
// the crests of the coarser ones. In about [0, 1]. Based on: Musgrave, Kolb, Mace. The Synthesis
// and Rendering of Eroded Fractal Terrains. 1989.
double ridgedNoise(uint64_t key, DVec2 p, int octaves) {
    double sum = 0.0, height = 0.6, weight = 1.0;
    for (int i = 0; i < octaves; ++i) {
        const double n = gradientNoise(key + uint64_t(i), p).value;
        const double ridge = 1.0 - std::sqrt(n * n + 0.0016);
        const double signal = ridge * ridge * weight;
        sum += height * signal;
        weight = std::clamp(1.5 * signal, 0.0, 1.0);
        height *= 0.42;
        p = DVec2(1.6 * p.x + 1.2 * p.y, -1.2 * p.x + 1.6 * p.y);
    }
    return sum;
}

// Heights of about 1 between low and high; p in units of the largest hills.
double rawHeight(TerrainStyle style, uint64_t key, const DVec2& p, int octaves) {
    // Domain warping bends crests and valleys.
    const int warp_octaves = std::min(octaves, 2);
    const DVec2 bend(fractalNoise(key + 1000, p * 0.9, warp_octaves),
                     fractalNoise(key + 2000, p * 0.9, warp_octaves));
    const DVec2 warped = p + 0.2 * bend;
    if (style != TerrainStyle::kMountain) return erodedNoise(key, warped, octaves);
    return 0.8 * ridgedNoise(key + 3000, warped, std::min(octaves, 4)) +
           0.5 * erodedNoise(key, warped * 1.3, octaves);
}

// What the ground of a place is like, by which its material is chosen.
struct GroundPlace {
    DVec3 position;
    double step = 0.0;             // metres between samples: what is finer is left out
    double relative_height = 0.0;  // 0: the lowest, 1: the highest
    double slope = 0.0;            // radians
    double hollow = 0.0;           // above 0: lower than around
    double above_water = 1e9;      // metres
};

// Noise in space, so that it is as coarse on a cliff as on level ground, without the octaves that
// samples `step` apart cannot show: those would be streaks along the triangles' edges.
double groundNoise(uint64_t key, const GroundPlace& place, double wavelength, int octaves) {
    constexpr double kSamplesPerWave = 4.0;
    while (octaves > 0 && wavelength / double(1 << (octaves - 1)) < kSamplesPerWave * place.step)
        --octaves;
    return octaves > 0 ? fractalNoise(key, place.position / wavelength, octaves) : 0.0;
}

DVec3 groundColor(TerrainStyle style, uint64_t key, const GroundPlace& place) {
    const double slope = place.slope, hollow = place.hollow;
    const double regions = groundNoise(key + 25, place, 260.0, 3);
    const double patches = groundNoise(key, place, 45.0, 4),
                 fine = groundNoise(key + 50, place, 3.5, 3);
    // Strata show where rock is bare.
    const double strata = std::sin(place.relative_height * 60.0 + 3.0 * patches + 2.0 * regions);
    const DVec3 rock = glm::mix(DVec3(0.235, 0.22, 0.2), DVec3(0.32, 0.295, 0.26),
                                0.5 + 0.25 * strata + 0.4 * patches) *
                       (1.0 + 0.35 * fine);
    const DVec3 scree = DVec3(0.27, 0.25, 0.22) * (1.0 + 0.3 * fine + 0.15 * patches);
    DVec3 meadow = glm::mix(DVec3(0.085, 0.135, 0.03), DVec3(0.155, 0.185, 0.05),
                            smoothStep(-0.6, 0.6, patches + 0.5 * fine + 0.6 * regions));
    meadow =
        glm::mix(meadow, DVec3(0.215, 0.18, 0.085),
                 0.7 * smoothStep(0.2, 0.7, patches - 0.6 * hollow + 0.35 * fine - 0.5 * regions));
    meadow = glm::mix(meadow, DVec3(0.06, 0.105, 0.028), 0.8 * smoothStep(0.1, 0.7, hollow));
    DVec3 color = meadow;
    double rock_slope = radians(38.0);
    if (style == TerrainStyle::kForestFloor) {
        color = glm::mix(DVec3(0.075, 0.055, 0.034), DVec3(0.125, 0.09, 0.052),
                         smoothStep(-0.4, 0.4, fine));
        color = glm::mix(color, DVec3(0.055, 0.085, 0.025),
                         0.85 * smoothStep(-0.1, 0.35, patches + 0.6 * fine + 0.3 * hollow));
    } else if (style == TerrainStyle::kMountain) {
        rock_slope = radians(41.0);
        const double high = place.relative_height + 0.12 * regions + 0.1 * patches;
        color = glm::mix(meadow, DVec3(0.15, 0.135, 0.065), smoothStep(0.15, 0.4, high));
        color = glm::mix(color, scree, smoothStep(0.38, 0.56, high - 0.15 * hollow));
    }
    color *= 1.0 + 0.22 * fine + 0.12 * patches;
    // Loose stones lie below the cliffs, where it is steep but not bare.
    color = glm::mix(color, scree,
                     0.8 * smoothStep(rock_slope - 0.26, rock_slope - 0.04,
                                      slope + 0.16 * patches + 0.12 * fine + 0.1 * hollow));
    color = glm::mix(
        color, rock,
        smoothStep(rock_slope - 0.1, rock_slope + 0.1, slope + 0.12 * patches + 0.1 * fine));
    if (style == TerrainStyle::kMountain) {
        // Snow lies high up and where it is not too steep, deeper in hollows.
        const double snow =
            smoothStep(0.56, 0.68,
                       place.relative_height + 0.1 * patches + 0.05 * fine + 0.12 * hollow) *
            smoothStep(radians(58.0), radians(44.0), slope + 0.1 * fine);
        color = glm::mix(color, DVec3(0.84, 0.87, 0.91), snow);
    }
    color *= 1.0 - 0.25 * std::clamp(hollow, -0.4, 1.0);
    // A shore of sand and gravel, dark where it is wet.
    const double shore = place.above_water + 0.8 * fine + 0.9 * patches;
    const DVec3 sand = DVec3(0.29, 0.25, 0.18) * (1.0 + 0.3 * fine);
    color = glm::mix(color, sand, smoothStep(2.4, 0.7, shore));
    return color * (1.0 - 0.5 * smoothStep(0.5, 0.05, place.above_water));
}

// Cuts gullies into steep rock above the water, deeper between buttresses than on them; summits
// stay.
void cutGullies(HeightField& field, double relief, double feature_size, double water,
                uint64_t key) {
    const HeightField before = field;
    const DVec2 step = field.size / DVec2(double(field.columns - 1), double(field.rows - 1));
    const double wavelength = feature_size / 9.0, depth = 0.04 * relief;
    const double reach = std::max(0.15 * wavelength, 2.0 * step.x);
    const int octaves =
        std::clamp(int(std::log2(std::max(wavelength / (4.0 * step.x), 1.0))) + 1, 1, 5);
    for (int j = 0; j < field.rows; ++j) {
        for (int i = 0; i < field.columns; ++i) {
            const DVec2 p = DVec2(i, j) * step - 0.5 * field.size;
            float& h = field.heights[size_t(j) * size_t(field.columns) + size_t(i)];
            // Judged over some samples, so that a gully begins softly at its crest.
            const DVec2 slope(before.height(p.x + reach, p.y) - before.height(p.x - reach, p.y),
                              before.height(p.x, p.y + reach) - before.height(p.x, p.y - reach));
            const double steep = smoothStep(0.35, 0.75, glm::length(slope) / (2.0 * reach)) *
                                 smoothStep(0.02, 0.1, (double(h) - water) / relief);
            if (steep <= 0.0) continue;
            const DVec2 q = p / wavelength;
            const DVec2 bend(fractalNoise(key + 1, q * 0.7, 2), fractalNoise(key + 2, q * 0.7, 2));
            h -= float(depth * steep * (1.0 - ridgedNoise(key, q + 0.35 * bend, octaves)));
        }
    }
}

// Shores are flatter than hills. Monotone.
double flattenShore(double above_water) {
    return above_water * (0.3 + 0.7 * smoothStep(0.0, 9.0, std::abs(above_water)));
}

constexpr double kRippleTile = 32.0;     // metres
constexpr float kSteepestRipple = 0.5f;  // slope that the ripples' map can hold

// Normals of waves 0.5 to 8 m long that wind has raised, kRippleTile wide and repeating: a map in
// tangent space, x along +x and y along -z, whose slopes count kSteepestRipple.
Texture rippleMap(uint64_t key) {
    constexpr int kSize = 256, kWaves = 48;
    constexpr double kSlope = 0.09;  // root mean square
    struct Wave {
        DVec2 count;  // over the tile
        double phase;
    };
    std::vector<Wave> waves;
    for (int i = 0; i < kWaves; ++i) {
        const auto random = [&](int k) { return uniformDouble(hashCombine(key, 8 * i + k)); };
        const double count = kRippleTile / (8.0 * std::pow(0.0625, random(0)));
        const double angle = 0.6 + 2.0 * (random(1) + random(2) - 1.0);
        waves.push_back(
            {glm::round(count * DVec2(std::cos(angle), std::sin(angle))), 2.0 * kPi * random(3)});
    }
    // Each wave is as steep: short ones are low.
    const double steepness = kSlope * std::sqrt(2.0 / kWaves);
    Texture map;
    map.name = "ripples";
    map.srgb = false;
    Texture::Level& level = map.levels.emplace_back();
    level.width = level.height = kSize;
    level.rgba.reserve(size_t(kSize) * kSize * 4);
    const auto encoded = [](double slope) {
        const double share = std::clamp(slope / double(kSteepestRipple), -1.0, 1.0);
        return uint8_t(std::lround(127.5 + 127.5 * share));
    };
    for (int y = 0; y < kSize; ++y) {
        for (int x = 0; x < kSize; ++x) {
            const DVec2 p = (DVec2(x, y) + 0.5) / double(kSize);
            DVec2 slope(0.0);
            for (const Wave& w : waves) {
                const double length = std::max(glm::length(w.count), 1.0);
                slope += w.count * (steepness / length *
                                    std::cos(2.0 * kPi * glm::dot(w.count, p) + w.phase));
            }
            level.rgba.insert(level.rgba.end(), {encoded(-slope.x), encoded(slope.y), 255, 255});
        }
    }
    buildMipmaps(map);
    return map;
}

// Over every cell that reaches below the water: flat, its colour by the depth beneath it, its
// normals moved a little by waves.
void appendWater(const HeightField& field, double level, uint64_t key, GeneratedMesh& terrain) {
    Mesh& mesh = terrain.mesh;
    const size_t n = size_t(field.columns), rows = size_t(field.rows);
    const DVec2 step = field.size / DVec2(double(n - 1), double(rows - 1));
    const double swell = std::max(14.0, 5.0 * step.x);  // wavelength, which samples can show
    std::vector<uint32_t> vertices(n * rows, UINT32_MAX);
    const auto vertexAt = [&](size_t i, size_t j) {
        uint32_t& v = vertices[j * n + i];
        if (v != UINT32_MAX) return v;
        v = uint32_t(mesh.positions.size());
        const DVec2 p = DVec2(double(i), double(j)) * step - 0.5 * field.size;
        const double depth = level - double(field.heights[j * n + i]);
        const double wind = fractalNoise(key, p / 160.0, 3);
        const DVec3 shallow(0.055, 0.06, 0.04), deep(0.01, 0.024, 0.03);
        const DVec3 color = glm::mix(shallow, deep, smoothStep(-0.2, 3.5, depth + 0.5 * wind));
        const double roughness = 0.02 + 0.02 * smoothStep(-0.3, 0.4, wind);
        const DVec3 normal(roughness * fractalNoise(key + 10, p / swell, 2), 1.0,
                           roughness * fractalNoise(key + 20, p / swell, 2));
        mesh.positions.push_back(Vec3(DVec3(p.x, level, p.y)));
        mesh.uvs.push_back(Vec2(p / kRippleTile));
        mesh.normals.push_back(Vec3(glm::normalize(normal)));
        mesh.colors.push_back(Vec4(Vec3(color) * float(1.0 + 0.25 * wind), 1.0f));
        return v;
    };
    for (size_t j = 0; j + 1 < rows; ++j) {
        for (size_t i = 0; i + 1 < n; ++i) {
            const float* row = field.heights.data() + j * n + i;
            if (std::min({row[0], row[1], row[n], row[n + 1]}) >= float(level)) continue;
            const uint32_t a = vertexAt(i, j), b = vertexAt(i + 1, j), c = vertexAt(i, j + 1),
                           d = vertexAt(i + 1, j + 1);
            mesh.triangles.push_back(UVec3(a, c, b));
            mesh.triangles.push_back(UVec3(b, c, d));
        }
    }
    mesh.triangle_material.resize(mesh.triangles.size(), 1);
    Material water;
    water.name = "water";
    water.base_color = Vec3(1.0f);
    water.specular = Vec3(0.02f);
    water.roughness = 0.15f;
    terrain.materials.push_back(water);
}

// A height field by samples; beyond the border the border's.
struct FieldSampler {
    const HeightField& field;

    DVec2 step() const { return field.size / DVec2(field.columns - 1, field.rows - 1); }
    double height(int i, int j) const {
        const size_t row = size_t(std::clamp(j, 0, field.rows - 1)),
                     column = size_t(std::clamp(i, 0, field.columns - 1));
        return double(field.heights[row * size_t(field.columns) + column]);
    }
    DVec3 position(int i, int j) const {
        return DVec3(-0.5 * field.size.x + i * step().x, height(i, j),
                     -0.5 * field.size.y + j * step().y);
    }
    DVec3 normal(int i, int j) const {
        const int n_x = std::min(i + 1, field.columns - 1) - std::max(i - 1, 0),
                  n_z = std::min(j + 1, field.rows - 1) - std::max(j - 1, 0);
        const double dx = (height(i + 1, j) - height(i - 1, j)) / (step().x * n_x),
                     dz = (height(i, j + 1) - height(i, j - 1)) / (step().y * n_z);
        return glm::normalize(DVec3(-dx, 1.0, -dz));
    }
};

}  // namespace

double HeightField::height(double x, double z) const {
    const double last_x = double(columns - 1), last_z = double(rows - 1);
    const double u = std::clamp((x / size.x + 0.5) * last_x, 0.0, last_x),
                 v = std::clamp((z / size.y + 0.5) * last_z, 0.0, last_z);
    const int i = std::min(int(u), columns - 2), j = std::min(int(v), rows - 2);
    const double fu = u - i, fv = v - j;
    // The corners of the cell and its diagonal b-c, as heightFieldMesh() splits it: what is placed
    // on the field stands on the mesh.
    const float* row = heights.data() + size_t(j) * size_t(columns) + size_t(i);
    const double a = row[0], b = row[1], c = row[columns], d = row[columns + 1];
    if (fu + fv < 1.0) return a + fu * (b - a) + fv * (c - a);
    return d + (1.0 - fu) * (c - d) + (1.0 - fv) * (b - d);
}

Vec3 HeightField::normal(double x, double z) const {
    const DVec2 step = size / DVec2(double(columns - 1), double(rows - 1));
    const DVec2 half = 0.5 * size;
    // Differences over what lies within the border.
    const double x0 = std::clamp(x - step.x, -half.x, half.x - step.x),
                 x1 = std::clamp(x + step.x, -half.x + step.x, half.x);
    const double z0 = std::clamp(z - step.y, -half.y, half.y - step.y),
                 z1 = std::clamp(z + step.y, -half.y + step.y, half.y);
    const double dx = (height(x1, z) - height(x0, z)) / (x1 - x0),
                 dz = (height(x, z1) - height(x, z0)) / (z1 - z0);
    return Vec3(glm::normalize(DVec3(-dx, 1.0, -dz)));
}

std::vector<std::string> terrainStyles() { return {"meadow", "forest_floor", "mountain"}; }

HeightField makeHeightField(const TerrainParams& params) {
    check(params);
    const TerrainStyle style = terrainStyle(params.style);
    HeightField field;
    field.columns = field.rows = params.resolution;
    field.size = DVec2(params.size);
    const size_t n = size_t(params.resolution);
    field.heights.resize(n * n);
    const double step = params.size / double(n - 1);
    // Down to waves of 3 samples.
    const int octaves =
        std::clamp(int(std::log2(std::max(params.feature_size / (3.0 * step), 1.0))) + 1, 1, 10);
    const uint64_t key = hashCombine(params.seed, 0x7e44);
    float low = kInfinity, high = -kInfinity;
    for (size_t j = 0; j < n; ++j) {
        for (size_t i = 0; i < n; ++i) {
            const DVec2 p(-0.5 * params.size + double(i) * step,
                          -0.5 * params.size + double(j) * step);
            const float h = float(rawHeight(style, key, p / params.feature_size, octaves));
            field.heights[j * n + i] = h;
            low = std::min(low, h), high = std::max(high, h);
        }
    }
    const float scale = high > low ? float(params.relief) / (high - low) : 0.0f;
    for (float& h : field.heights) {
        h = (h - low) * scale;
        // Mountains rise from wide valleys.
        if (style == TerrainStyle::kMountain && scale > 0.0f)
            h = float(params.relief) * std::pow(h / float(params.relief), 1.8f);
    }
    const double water = params.water_level;
    if (params.erosion > 0.0 && scale > 0.0f) {
        erode(field, params.erosion, water, params.seed);
        // Back to the relief asked for; what lies under water is as it was.
        const auto [least, most] = std::minmax_element(field.heights.begin(), field.heights.end());
        const double base = water > 0.0 ? water : double(*least);
        const double stretch = (params.relief - std::max(water, 0.0)) / (double(*most) - base);
        for (float& h : field.heights) {
            if (stretch > 0.0 && double(h) >= base)
                h = float(params.relief - (double(*most) - double(h)) * stretch);
        }
    }
    if (style == TerrainStyle::kMountain && params.erosion > 0.0 && scale > 0.0f)
        cutGullies(field, params.relief, params.feature_size, water, hashCombine(key, 0x6711));
    if (water > 0.0) {
        for (float& h : field.heights) h = float(water + flattenShore(double(h) - water));
    }
    return field;
}

Mesh heightFieldMesh(const HeightField& field) {
    const FieldSampler sample{field};
    const int n_x = field.columns, n_z = field.rows;
    const size_t count = size_t(n_x) * size_t(n_z);
    Mesh mesh;
    mesh.name = "terrain";
    mesh.positions.reserve(count);
    mesh.normals.reserve(count);
    mesh.uvs.reserve(count);
    for (int j = 0; j < n_z; ++j) {
        for (int i = 0; i < n_x; ++i) {
            mesh.positions.push_back(Vec3(sample.position(i, j)));
            mesh.normals.push_back(Vec3(sample.normal(i, j)));
            mesh.uvs.push_back(Vec2(double(i) / (n_x - 1), double(j) / (n_z - 1)));
        }
    }
    mesh.triangles.reserve(2 * size_t(n_x - 1) * size_t(n_z - 1));
    for (int j = 0; j + 1 < n_z; ++j) {
        for (int i = 0; i + 1 < n_x; ++i) {
            const uint32_t a = uint32_t(j) * uint32_t(n_x) + uint32_t(i), b = a + 1,
                           c = a + uint32_t(n_x), d = c + 1;
            mesh.triangles.push_back(UVec3(a, c, b));
            mesh.triangles.push_back(UVec3(b, c, d));
        }
    }
    mesh.triangle_material.assign(mesh.triangles.size(), 0);
    return mesh;
}

GeneratedMesh makeTerrain(const TerrainParams& params, const HeightField& field) {
    const TerrainStyle style = terrainStyle(params.style);
    const uint64_t key = hashCombine(params.seed, 0x7e45);
    GeneratedMesh result;
    Mesh& mesh = result.mesh;
    mesh = heightFieldMesh(field);
    // Only ripples on water are a texture.
    mesh.uvs.assign(params.water_level > 0.0 ? mesh.positions.size() : 0, Vec2(0.0f));
    mesh.colors.reserve(mesh.positions.size());
    const FieldSampler sample{field};
    const auto [least, most] = std::minmax_element(field.heights.begin(), field.heights.end());
    const double low = *least, relief = double(*most) - low;
    const double step = std::min(sample.step().x, sample.step().y);
    const int reach = std::max(1, int(6.0 / step));  // samples: hollows are judged over some metres
    for (int j = 0; j < field.rows; ++j) {
        for (int i = 0; i < field.columns; ++i) {
            const DVec3 p = sample.position(i, j), normal = sample.normal(i, j);
            const double around =
                0.25 * (sample.height(i - reach, j) + sample.height(i + reach, j) +
                        sample.height(i, j - reach) + sample.height(i, j + reach));
            const double hollow = 4.0 * (around - p.y) / (reach * step);
            const double relative_height = relief > 0.0 ? (p.y - low) / relief : 0.0;
            // Samples lie farther apart along a slope.
            GroundPlace place{p, step / std::max(normal.y, 0.2), relative_height,
                              std::acos(std::min(normal.y, 1.0)), hollow};
            if (params.water_level > 0.0) place.above_water = p.y - params.water_level;
            const DVec3 color = groundColor(style, key, place);
            mesh.colors.push_back(Vec4(Vec3(glm::clamp(color, DVec3(0.0), DVec3(1.0))), 1.0f));
        }
    }
    Material material;
    material.name = "ground";
    material.base_color = Vec3(1.0f);
    result.materials.push_back(material);
    if (params.water_level > 0.0) {
        const uint64_t water_key = hashCombine(params.seed, 0x7e46);
        appendWater(field, params.water_level, water_key, result);
        result.textures.push_back(rippleMap(water_key + 30));
        result.materials.back().normal_map.texture = 0;
        result.materials.back().normal_scale = kSteepestRipple;
    }
    return result;
}

}  // namespace stipple
