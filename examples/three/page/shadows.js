// A shadow map that holds four moments of depth, and the filter of the light's shadow that reads it.

import {
    FloatType, LinearFilter, NoBlending, NodeMaterial, QuadMesh, RenderTarget,
} from "three/webgpu";
import {
    Fn, Loop, cameraFar, cameraNear, float, positionView, texture, uv, vec2, vec4, viewZToOrthographicDepth,
} from "three/tsl";
// Glue:
import * as hankel from "../libraries/tsl/hankel_shadows.tsl.js";
// End of glue.

/** Texels of the map, and of the one before its filter. */
const SIZE = 256;
const FINE = 2 * SIZE;

/** Gives the light moment shadows. What comes back draws their map anew: call it before each frame. */
export function withMoments(renderer, scene, light) {
    const floats = { type: FloatType, minFilter: LinearFilter, magFilter: LinearFilter };
    const fine = new RenderTarget(FINE, FINE, floats);
    const map = new RenderTarget(SIZE, SIZE, { ...floats, depthBuffer: false });

    // What the light sees.
    const seen = new NodeMaterial();
    seen.blending = NoBlending;
    const depth = viewZToOrthographicDepth(positionView.z, cameraNear, cameraFar);
    // Glue:
    seen.fragmentNode = hankel.momentsOfDepth(hankel.symmetricDepth(depth));
    // End of glue.

    // Its mean over four texels of the map along each side.
    const filter = new NodeMaterial();
    filter.blending = NoBlending;
    filter.fragmentNode = Fn(() => {
        const sum = vec4(0).toVar();
        Loop(8, 8, ({ i, j }) => {
            const offset = vec2(float(i), float(j)).sub(3.5).div(FINE);
            sum.addAssign(texture(fine.texture, uv().add(offset)).level(0));
        });
        return sum.div(64);
    })();
    const quad = new QuadMesh(filter);

    // Glue:
    light.shadow.filterNode = Fn(({ shadowCoord }) => {
        const stored = texture(map.texture, shadowCoord.xy).level(0);
        const moments = hankel.mixBias(stored, hankel.SYMMETRIC_FOUR_FLOAT_TARGET,
            hankel.SYMMETRIC_FOUR_FLOAT_STRENGTH);
        const least = hankel.hamburgerBound(moments, hankel.symmetricDepth(shadowCoord.z));
        return hankel.cutLeak(least, 0.02).oneMinus();
    });
    // End of glue.

    return () => {
        const { background } = scene;
        const target = renderer.getRenderTarget();
        light.updateMatrixWorld();
        light.target.updateMatrixWorld();
        light.shadow.camera.coordinateSystem = renderer.coordinateSystem;
        light.shadow.camera.updateProjectionMatrix();
        light.shadow.updateMatrices(light);
        scene.background = null;
        scene.overrideMaterial = seen;
        renderer.setRenderTarget(fine);
        renderer.render(scene, light.shadow.camera);
        scene.overrideMaterial = null;
        scene.background = background;
        renderer.setRenderTarget(map);
        quad.render(renderer);
        renderer.setRenderTarget(target);
    };
}
