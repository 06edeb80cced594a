// What the examples draw, in three.js: a ground, a fence, a block and a ball. Nothing of Hankel.

import {
    AmbientLight, BoxGeometry, CircleGeometry, Color, DirectionalLight, Mesh, MeshLambertNodeMaterial,
    PerspectiveCamera, Scene, SphereGeometry,
} from "three/webgpu";

/** Pixels of the picture. */
export const SIZE = [600, 360];

/** The scene, the camera and the lights. */
export function makeScene() {
    const scene = new Scene();
    scene.background = new Color().setRGB(0.62 ** 2, 0.75 ** 2, 0.9 ** 2);
    const add = (geometry, colour, x, y, z) => {
        const mesh = new Mesh(geometry, new MeshLambertNodeMaterial({ color: new Color().setRGB(...colour) }));
        mesh.position.set(x, y, z);
        mesh.castShadow = true;
        mesh.receiveShadow = true;
        scene.add(mesh);
    };
    const wood = [0.75, 0.5, 0.3];
    // As far as 100 from the camera.
    add(new CircleGeometry(99.94, 256).rotateX(-Math.PI / 2), [0.7, 0.72, 0.68], -0.6, 0, 6);
    for (let i = 0; i < 6; i += 1) add(new BoxGeometry(0.16, 2.2, 0.16), wood, 0.6 * i - 4, 1.1, -0.5);
    add(new BoxGeometry(3.6, 0.14, 0.2), wood, -2.5, 1.9, -0.5);
    add(new BoxGeometry(1.4, 1.8, 1.4), wood, 2.6, 0.9, -1.6);
    add(new SphereGeometry(0.7, 128, 64), [0.35, 0.55, 0.8], 1.1, 1, 0.9);

    const camera = new PerspectiveCamera((2 * Math.atan(0.5) * 180) / Math.PI, SIZE[0] / SIZE[1], 0.1, 1000);
    camera.position.set(-0.6, 3.4, 6);
    camera.lookAt(-0.6, 3.4 - 0.41036, 6 - 0.91192);

    // Lambert's law divides by pi.
    const ambient = new AmbientLight(0xffffff, 0.12 * Math.PI);
    const light = new DirectionalLight(0xffffff, 0.85 * Math.PI);
    light.position.set(14 * 0.6, 14 * 0.64, 14 * -0.48);
    light.castShadow = true;
    Object.assign(light.shadow.camera, { left: -7, right: 7, bottom: -7, top: 7, near: 0, far: 28 });
    light.shadow.mapSize.set(256, 256);
    light.shadow.bias = -5e-4;
    light.shadow.normalBias = 0.03;
    scene.add(ambient, light, light.target);
    return { scene, camera, ambient, light };
}
